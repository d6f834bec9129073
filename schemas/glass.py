"""The glass plate of a scan: the plane in which the skin is pressed onto it, where the films show it."""

import math
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from schemas.base.model import Document

Camera = Annotated[int, Field(ge=1)]
Deviation = Annotated[float, Field(ge=0)]
Term = Literal["height", "tilt_x", "tilt_y"]


class Plane(NamedTuple):
    """Z = `height` + `along` X + `across` Y, mm, scanner frame."""

    height: float = 0.0
    along: float = 0.0
    across: float = 0.0


CALIBRATED = Plane()
"""The glass as it was at the calibration."""


class GlassPlane(Document):
    """The upper face of the plate during a scan; the calibration has it at Z = 0.

    Terms that the contact does not support are 0, and their standard deviations null.
    """

    height_mm: float = 0.0
    """Z of the glass at X = Y = 0."""
    height_sd_mm: Deviation | None = None
    """Null also where a tilt is not supported: the place is outside the contact."""
    tilt_x_deg: float = 0.0
    """Tilt about X: the glass rises with Y."""
    tilt_x_sd_deg: Deviation | None = None
    tilt_y_deg: float = 0.0
    """Tilt about Y: the glass falls with X."""
    tilt_y_sd_deg: Deviation | None = None
    below_foot_mm: float = 0.0
    """Z of the glass in the middle of the contact, where it is known best."""
    below_foot_sd_mm: Deviation | None = None
    largest_mm: Deviation = 0.0
    """Largest distance of the glass from Z = 0 below the foot."""
    supported: list[Term] = Field(default_factory=list)
    """Terms that the contact supports."""
    cameras: list[Camera] = Field(default_factory=list)
    """Cameras below the glass that see the contact and agree on it."""
    contact_mm2: Annotated[float, Field(ge=0)] = 0.0
    """Area of the skin on the glass."""
    stripes: Annotated[int, Field(ge=0)] = 0
    """Stripe planes that meet it."""
    corrected: bool = False
    """True if this plane took the place of Z = 0; false if it is Z = 0 within its standard deviations, or unknown."""

    @property
    def plane(self) -> Plane:
        """The glass to reckon with."""
        if not self.corrected:
            return CALIBRATED
        along, across = -math.tan(math.radians(self.tilt_y_deg)), math.tan(math.radians(self.tilt_x_deg))
        return Plane(self.height_mm, along, across)
