"""Where a camera stands: a symmetric reference object in one placement looks the same from several sides."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from schemas.calibration import view_number
from schemas.scan import CameraSource, LaserNumber

Stand = Literal["front", "behind", "left", "right", "above", "below"]
Sign = Literal[-1, 0, 1]

_OPPOSITES: tuple[tuple[Stand, Stand], ...] = (("front", "behind"), ("left", "right"), ("above", "below"))
"""On the positive and the negative side of X, Y and Z."""


def _no_opposites(stands: list[Stand]) -> list[Stand]:
    for pair in _OPPOSITES:
        if sum(stand in pair for stand in stands) > 1:
            raise ValueError(f"expected at most one of {' and '.join(pair)}")
    return stands


Stands = Annotated[list[Stand], AfterValidator(_no_opposites)]


class CaptureCamera(CameraSource):
    """One camera of a capture."""

    stands: Stands | None = None
    """Sides of the object on which the camera stands: front (+X) or behind, left (+Y) or right, above or below. Any of
    them may be left out; where all are absent, the camera's number says it."""
    laser: LaserNumber = 1
    """Number of the laser that shines in this film, among those of the camera's head; the others are covered."""
    x_mm: Annotated[float, Field(ge=-1e4, le=1e4)] | None = None
    """Where the plane of this laser stands; default: where that of the capture does."""

    @property
    def view(self) -> int:
        """Number of the view, as in `schemas.calibration.view_number`."""
        return view_number(self.id, self.laser)


@dataclass(frozen=True)
class Mounting:
    """The side of the object on which a camera stands, along each axis: +1, -1, or 0 where it is not known."""

    x: Sign
    y: Sign
    z: Sign

    def __str__(self) -> str:
        """Its sides by name: front, left, above."""
        signs = zip((self.x, self.y, self.z), _OPPOSITES, strict=True)
        return ", ".join(pair[0 if sign > 0 else 1] for sign, pair in signs if sign)

    def contradicts(self, other: "Mounting") -> bool:
        """Whether both know a side, and it is not the same."""
        return any(a * b < 0 for a, b in ((self.x, other.x), (self.y, other.y), (self.z, other.z)))


def mounting_of(camera: CaptureCamera) -> Mounting:
    """Where `camera` stands, by what its capture says or else by the numbering of the scanner's cameras."""
    if camera.stands is None:
        return mounting_by_number(camera.id)
    x, y, z = (_sign(camera.stands, *pair) for pair in _OPPOSITES)
    return Mounting(x, y, z)


def _sign(stands: list[Stand], positive: Stand, negative: Stand) -> Sign:
    if positive in stands:
        return 1
    return -1 if negative in stands else 0


def mounting_by_number(camera_id: int) -> Mounting:
    """1 and 2 stand left above, 3 and 4 right above, 5 and 6 left below, 7 and 8 right below; odd ones in front."""
    if camera_id > 8:
        return Mounting(0, 0, 0)
    return Mounting(1 if camera_id % 2 else -1, 1 if camera_id in (1, 2, 5, 6) else -1, 1 if camera_id <= 4 else -1)
