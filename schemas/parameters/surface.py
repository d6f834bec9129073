"""Parameters of the surface reconstruction."""

from typing import Annotated

from pydantic import Field

from schemas.documents import Document

Radius = Annotated[float, Field(gt=0, le=50)]


class SurfaceParameters(Document):
    """How a cloud becomes a triangle mesh. What ends in `_steps` is in steps from stripe to stripe, 2 mm as a rule."""

    spacing_steps: Annotated[float, Field(ge=0.2, le=5)] = 0.75
    """Spacing that the cloud is thinned to before meshing."""
    smoothing_steps: Annotated[float, Field(ge=1, le=10)] = 1.75
    """Radius of the neighbourhood that the thinned points are smoothed over; it must reach the next stripe planes."""
    ball_radii_steps: Annotated[tuple[Radius, ...], Field(min_length=1, max_length=8)] = (0.75, 1.25)
    """Radii of the balls, the smallest first."""
    component_share: Annotated[float, Field(ge=0, lt=1)] = 0.05
    """Parts of the mesh with less than this share of its triangles are dropped."""
    hole_mm: Annotated[float, Field(ge=0, le=10_000)] = 190.0
    """Holes with at most this perimeter are closed. The opening at the ankle, 200 mm around and more, stays."""
    slit_mm: Annotated[float, Field(ge=0, le=1000)] = 20.0
    """Slits in larger holes are closed where their mouth is at most so wide."""
