"""Parameters of the surface reconstruction."""

from typing import Annotated, Literal

from pydantic import Field

from schemas.base.model import Document

Radius = Annotated[float, Field(gt=0, le=50)]


class SurfaceParameters(Document):
    """Parameters of a mesh from a cloud; the unit of `_steps` is the step from stripe to stripe, usually 2 mm."""

    method: Literal["closed", "ball_pivoting"] = "closed"
    """`closed` leaves no hole; `ball_pivoting` is the method of the thesis, open where no camera saw the surface."""
    grid_steps: Annotated[float, Field(ge=0.2, le=5)] = 0.625
    """`closed`: spacing of its vertices, at least 1 mm."""
    blur_steps: Annotated[float, Field(ge=0.2, le=5)] = 0.625
    """`closed`: extent to which the rough surface is smoothed before the points attract it."""
    reach_steps: Annotated[float, Field(ge=1, le=10)] = 1.75
    """Radius of the neighbourhood whose points attract a vertex; it must reach the next stripes. Along them, half."""
    gap_steps: Annotated[float, Field(gt=0, le=10)] = 0.6
    """A vertex farther than this from all points counts as filled; half a step is the middle between two stripes."""
    spacing_steps: Annotated[float, Field(ge=0.2, le=5)] = 0.75
    """`ball_pivoting`, as all further fields: spacing to which the cloud is thinned before meshing."""
    ball_radii_steps: Annotated[tuple[Radius, ...], Field(min_length=1, max_length=8)] = (0.75, 1.25)
    """Radii of the balls, the smallest first."""
    component_share: Annotated[float, Field(ge=0, lt=1)] = 0.05
    """Parts of the mesh with less than this share of its triangles are dropped."""
    hole_mm: Annotated[float, Field(ge=0, le=10_000)] = 190.0
    """Holes with at most this perimeter are closed. The opening at the ankle, 200 mm around and more, stays."""
    slit_mm: Annotated[float, Field(ge=0, le=1000)] = 20.0
    """Slits in larger holes are closed if their mouth is at most this wide."""
