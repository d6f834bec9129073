"""Parameters of the surface reconstruction."""

from typing import Annotated, Literal

from pydantic import Field

from schemas.base.model import Document

Radius = Annotated[float, Field(gt=0, le=50)]


class SurfaceParameters(Document):
    """How a cloud becomes a triangle mesh. What ends in `_steps` is in steps from stripe to stripe, 2 mm as a rule."""

    method: Literal["closed", "ball_pivoting"] = "closed"
    """`closed` leaves no hole; `ball_pivoting` is that of the thesis, open where no camera saw anything."""
    grid_steps: Annotated[float, Field(ge=0.2, le=5)] = 0.625
    """`closed`: spacing of its vertices, though never less than 1 mm."""
    blur_steps: Annotated[float, Field(ge=0.2, le=5)] = 0.625
    """`closed`: how far the rough surface is smoothed that the points then draw towards them."""
    reach_steps: Annotated[float, Field(ge=1, le=10)] = 1.75
    """Radius of the neighbourhood whose points draw a vertex; it must reach the next stripes."""
    gap_steps: Annotated[float, Field(gt=0, le=10)] = 0.6
    """A vertex that lies farther from all points counts as filled; half a step is the middle between two."""
    spacing_steps: Annotated[float, Field(ge=0.2, le=5)] = 0.75
    """`ball_pivoting`, as all that follow: spacing that the cloud is thinned to before meshing."""
    ball_radii_steps: Annotated[tuple[Radius, ...], Field(min_length=1, max_length=8)] = (0.75, 1.25)
    """Radii of the balls, the smallest first."""
    component_share: Annotated[float, Field(ge=0, lt=1)] = 0.05
    """Parts of the mesh with less than this share of its triangles are dropped."""
    hole_mm: Annotated[float, Field(ge=0, le=10_000)] = 190.0
    """Holes with at most this perimeter are closed. The opening at the ankle, 200 mm around and more, stays."""
    slit_mm: Annotated[float, Field(ge=0, le=1000)] = 20.0
    """Slits in larger holes are closed where their mouth is at most so wide."""
