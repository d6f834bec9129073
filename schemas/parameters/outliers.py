"""Parameters of the outlier filter."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from schemas.base.model import Document

Range = tuple[float, float]
Share = Annotated[float, Field(ge=0, le=1)]


class OutlierParameters(Document):
    """Which points are dropped."""

    x_mm: Range = (-500.0, 500.0)
    """Control volume along the travel; wide, for the travel itself bounds X."""
    y_mm: Range = (-75.0, 75.0)
    """Control volume across the travel."""
    z_mm: Range = (-150.0, 120.0)
    """Control volume in height; it takes in the mirror image below the glass, which has a limit of its own."""
    drop_unsupported: bool = True
    """Drop points of pixels that no control point of the calibration supports."""
    glass_mm: Annotated[float, Field(ge=0, le=50)] = 0.5
    """Nothing is farther below the glass, at Z = 0; what lies no farther from it beside the foot is the glass."""
    gap_mm: Annotated[float, Field(gt=0, le=50)] = 1.5
    """A segment of stripe ends where the next point is farther away, ..."""
    segment_mm: Annotated[float, Field(gt=0, le=1000)] = 15.0
    """... or when it is so long; points of one segment are kept or dropped together."""
    end_points: Annotated[int, Field(ge=0, le=100)] = 4
    """So many points at each end of a piece of stripe are dropped where another camera sees the place: there the
    stripe's profile is cut off, and its centre runs away."""
    shortest: Annotated[int, Field(ge=1, le=1000)] = 3
    """Segments of fewer points are dropped where no other camera has points beside them."""
    beside_mm: Annotated[float, Field(gt=0, le=50)] = 4.0
    """How far a segment is from those in the planes before and behind it, in Y and Z; three times as far where there
    are none on one side: the first stripes of heel and toes grow fast."""
    beside_share: Share = 0.3
    """A segment is isolated when fewer of its points have others so far away."""
    fewest_cameras: Annotated[int, Field(ge=2, le=64)] = 4
    """With fewer cameras nobody is asked to confirm what another one sees."""
    denied_share: Share = 0.5
    """A segment is dropped when other cameras should see more of its points, and do not, ..."""
    confirmed_share: Share = 0.25
    """... unless they see more than this share."""
    static_share: Share = 0.7
    """What stands at the same Y and Z in more of a camera's first and of its last frames travels with the heads."""
    island_gap_steps: Annotated[float, Field(gt=0, le=50)] = 2.5
    """Parts of the cloud closer than about so many steps from stripe to stripe belong together."""
    island_share: Annotated[float, Field(ge=0, lt=1)] = 0.005
    """Parts with less than this share of the cloud's points are dropped."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for name in ("x_mm", "y_mm", "z_mm"):
            low, high = getattr(self, name)
            if low >= high:
                raise ValueError(f"{name}: expected the lower limit first, found {low} and {high}")
        return self
