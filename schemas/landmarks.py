"""landmarks.yaml: landmarks that a person has set on the mesh of a foot."""

from typing import Annotated, Literal

from pydantic import Field

from schemas.base.model import Document
from schemas.choices import Decided

Coordinate = Annotated[float, Field(ge=-1e4, le=1e4)]
LandmarkPosition = tuple[Coordinate, Coordinate, Coordinate]


class Places(Document):
    """x, y and z of each landmark that was set."""

    pternion: LandmarkPosition | None = None
    landing_point: LandmarkPosition | None = None
    metatarsale_tibiale: LandmarkPosition | None = None
    metatarsale_fibulare: LandmarkPosition | None = None
    toe_1_tip: LandmarkPosition | None = None
    toe_2_tip: LandmarkPosition | None = None
    toe_3_tip: LandmarkPosition | None = None
    toe_4_tip: LandmarkPosition | None = None
    toe_5_tip: LandmarkPosition | None = None
    first_metatarsal_head_top: LandmarkPosition | None = None
    second_metatarsal_head_top: LandmarkPosition | None = None
    instep_point: LandmarkPosition | None = None
    junction_point: LandmarkPosition | None = None
    navicular: LandmarkPosition | None = None
    medial_malleolus: LandmarkPosition | None = None
    lateral_malleolus: LandmarkPosition | None = None
    fifth_metatarsal_tuberosity: LandmarkPosition | None = None
    heel_medial: LandmarkPosition | None = None
    heel_lateral: LandmarkPosition | None = None


LANDMARKS = tuple(Places.model_fields)
"""Names of all landmarks."""


class ManualLandmarks(Document):
    """The content of landmarks.yaml."""

    format: Literal["footscan.landmarks/1"]
    unit: Literal["mm"] = "mm"
    landmarks: Places
    """In the frame of the mesh, as its file has it; in mm, whatever the unit of that file."""
    decided: dict[str, Decided] = Field(default_factory=dict)
    """Who set each landmark, and when."""

    def points(self) -> dict[str, LandmarkPosition]:
        """Those that were set, by their names."""
        set_: dict[str, LandmarkPosition] = self.landmarks.model_dump(exclude_none=True)
        return set_
