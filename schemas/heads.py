"""Where a scan shows its heads to be, beside where its calibration says."""

from typing import Annotated

from pydantic import Field

from schemas.base.model import Document

Number = Annotated[float, Field(ge=-1e3, le=1e3)]
Length = Annotated[float, Field(ge=0)]

FILM_BODY = "`footscan calibrate film`, or “Calibrate or check” in the console"
"""What to do about heads that are not where the calibration says."""


class HeadPlace(Document):
    """The laser plane of one head, relative to the calibration and to the mean of all heads. X of a point of it is

    x + offset_mm + yaw Y + pitch (Z - 57) + scale (x - x_mm),

    with x the place by the calibration, and `x_mm` that of the report.
    """

    head: Annotated[int, Field(ge=1)]
    cameras: Annotated[list[int], Field(min_length=1)]
    offset_mm: Number = 0.0
    yaw: Number = 0.0
    """mm per mm, as all that follow."""
    pitch: Number = 0.0
    scale: Number = 0.0
    sd: Annotated[list[Length], Field(min_length=4, max_length=4)]
    """Standard deviations of the four, in their order."""


class HeadsReport(Document):
    """The places of all heads; without heads if the scan does not show them."""

    heads: list[HeadPlace] = Field(default_factory=list)
    x_mm: Number = 0.0
    """Where the offsets hold."""
    points: Annotated[int, Field(ge=0)] = 0
    """Number of points of cameras on known heads."""
    comparisons: Annotated[int, Field(ge=0)] = 0
    """Number of places at which cameras of two heads were compared."""
    before_mm: Length | None = None
    """Robust standard deviation of the distances between cameras of two heads, with the heads as calibrated, mm."""
    after_mm: Length | None = None
    """The same if the heads are where this report says."""
    largest_mm: Length = 0.0
    """Largest displacement of a point along X."""
    strays_mm: Length = 0.0
    """How far a head strays from its place, from one stretch of the travel to the next, root mean square"""
    is_corrected: bool = False
    """True if the points of this scan were displaced so."""
    warnings: list[str] = Field(default_factory=list)
    doubt: str | None = None
    """Reason for which measures are uncertain, if heads are farther off than a scan can make good, or one strays."""
