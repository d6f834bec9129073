"""Parameters of the outlier filter."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from schemas.documents import Document

Range = tuple[float, float]


class OutlierParameters(Document):
    """Which points of a cloud are dropped."""

    x_mm: Range = (-500.0, 500.0)
    """Control volume along the travel; wide, for the travel itself bounds X."""
    y_mm: Range = (-75.0, 75.0)
    """Control volume across the travel."""
    z_mm: Range = (-0.5, 120.0)
    """The sole rests on the glass at Z = 0; below it stands the foot's mirror image."""
    drop_unsupported: bool = True
    """Drop points of pixels that no control point of the calibration supports."""
    spacing_mm: Annotated[float, Field(gt=0, le=50)] = 0.5
    """Distance of neighbouring points within a stripe plane."""
    neighbours: Annotated[int, Field(ge=2, le=200)] = 24
    """How many nearest points a point is held against."""
    distance_ratio: Annotated[float, Field(gt=1, le=100)] = 3.0
    """A point is far from its neighbours when their mean distance exceeds this many times the cloud's median."""
    off_surface_mm: Annotated[float, Field(gt=0, le=50)] = 0.5
    """A point closer than this to the plane through its neighbours is never off the surface."""
    off_surface_ratio: Annotated[float, Field(gt=1, le=100)] = 4.0
    """A point is off the surface when it is farther from that plane than so many times its neighbours' deviation."""
    island_gap_steps: Annotated[float, Field(gt=0, le=50)] = 2.5
    """Parts of the cloud closer than about so many steps from stripe to stripe belong together."""
    island_share: Annotated[float, Field(ge=0, lt=1)] = 0.02
    """Parts with less than this share of the cloud's points are dropped."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for name in ("x_mm", "y_mm", "z_mm"):
            low, high = getattr(self, name)
            if low >= high:
                raise ValueError(f"{name}: expected the lower limit first, found {low} and {high}")
        return self
