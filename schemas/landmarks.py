"""landmarks.yaml: landmarks that a person has set on the mesh of a foot."""

from typing import Annotated, Literal

from pydantic import Field

from schemas.base.model import Document

Coordinate = Annotated[float, Field(ge=-1e4, le=1e4)]
Place = tuple[Coordinate, Coordinate, Coordinate]


class Places(Document):
    """x, y and z of each landmark that was set."""

    pternion: Place | None = None
    landing_point: Place | None = None
    metatarsale_tibiale: Place | None = None
    metatarsale_fibulare: Place | None = None
    toe_1_tip: Place | None = None
    toe_2_tip: Place | None = None
    toe_3_tip: Place | None = None
    toe_4_tip: Place | None = None
    toe_5_tip: Place | None = None
    first_metatarsal_head_top: Place | None = None
    second_metatarsal_head_top: Place | None = None
    instep_point: Place | None = None
    junction_point: Place | None = None
    navicular: Place | None = None
    medial_malleolus: Place | None = None
    lateral_malleolus: Place | None = None
    fifth_metatarsal_tuberosity: Place | None = None
    heel_medial: Place | None = None
    heel_lateral: Place | None = None


LANDMARKS = tuple(Places.model_fields)
"""Names of all landmarks."""


class ManualLandmarks(Document):
    """The content of landmarks.yaml."""

    format: Literal["footscan.landmarks/1"]
    unit: Literal["mm"] = "mm"
    landmarks: Places
    """In the frame of the mesh, as its file has it; in mm, whatever the unit of that file."""

    def points(self) -> dict[str, Place]:
        """Those that were set, by their names."""
        set_: dict[str, Place] = self.landmarks.model_dump(exclude_none=True)
        return set_
