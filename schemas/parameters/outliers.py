"""Parameters of the outlier filter."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from schemas.base.model import Document

Range = tuple[float, float]
Share = Annotated[float, Field(ge=0, le=1)]


class OutlierParameters(Document):
    """Limits beyond which points are dropped."""

    method: Literal["evidence", "levels"] = "evidence"
    """`evidence` of other cameras, neighbouring frames and the glass; or the three `levels` of the thesis, for
    comparison: nearest distance, control volume, median. The levels use `nearest_mm`, the volume and `median_mm`
    alone."""
    nearest_mm: Annotated[float, Field(gt=0, le=50)] = 2.0
    """Level of the nearest distance: points without another one within this distance are dropped."""
    median_mm: Annotated[float, Field(gt=0, le=50)] = 1.0
    """Level of the median: points farther than this from the median of their neighbours along the stripe are
    dropped."""

    x_mm: Range | None = None
    """Control volume along the travel; null for the reach of the heads: from the first frame to the last."""
    y_mm: Range | None = None
    """Control volume across the travel; null for all that the calibration supports."""
    z_mm: Range | None = None
    """Control volume in height; null for all that the calibration supports. It includes the mirror image below the
    glass, which `glass_mm` limits."""
    largest_cut: Share = 0.01
    """Share of a camera's points on stripes of the foot that may lie outside without a warning."""
    drop_unsupported: bool = True
    """Drop points of pixels that no control point of the calibration supports."""
    glass_mm: Annotated[float, Field(ge=0, le=50)] = 0.5
    """Points farther below the glass are dropped; points beside the foot this near to it are the glass. A warning says
    so if the plate was moved by more since the calibration."""
    gap_mm: Annotated[float, Field(gt=0, le=50)] = 1.5
    """A segment of stripe ends where the next point is farther away than this, ..."""
    segment_mm: Annotated[float, Field(gt=0, le=1000)] = 15.0
    """... or where it reaches this length; points of one segment are kept or dropped together."""
    end_points: Annotated[int, Field(ge=0, le=100)] = 4
    """Points dropped at each end of a piece of stripe if another camera sees the place: the stripe's profile is cut off
    there, and its centre is displaced."""
    shortest: Annotated[int, Field(ge=1, le=1000)] = 3
    """Segments of fewer points are dropped if no other camera has points beside them."""
    beside_mm: Annotated[float, Field(gt=0, le=50)] = 4.0
    """Distance in Y and Z within which a segment has neighbours in the planes before and behind it; three times as far
    where one side has none: the first stripes of heel and toes grow fast."""
    beside_share: Share = 0.3
    """A segment is isolated if less than this share of its points has neighbours within `beside_mm`."""
    fewest_cameras: Annotated[int, Field(ge=2, le=64)] = 4
    """With fewer cameras, no camera has to confirm the points of another."""
    denied_share: Share = 0.5
    """A segment is dropped if other cameras should see more than this share of its points, and do not, ..."""
    confirmed_share: Share = 0.25
    """... unless they see more than this share."""
    static_share: Share = 0.7
    """Points at the same Y and Z in more of a camera's first and of its last frames travel with the heads."""
    island_gap_steps: Annotated[float, Field(gt=0, le=50)] = 2.5
    """Parts of the cloud that are closer than about this number of steps from stripe to stripe belong together."""
    island_share: Annotated[float, Field(ge=0, lt=1)] = 0.005
    """Parts with less than this share of the cloud's points are dropped."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for name in ("x_mm", "y_mm", "z_mm"):
            limits = getattr(self, name)
            if limits is not None and limits[0] >= limits[1]:
                raise ValueError(f"{name}: expected the lower limit first, found {limits[0]} and {limits[1]}")
        return self
