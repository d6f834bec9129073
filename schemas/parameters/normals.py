"""Parameters of the estimation of normals."""

from typing import Annotated

from pydantic import Field

from schemas.base.model import Document


class NormalParameters(Document):
    """Size of the neighbourhood for plane fits, and the angle from which a camera decides the sign of a normal."""

    radius_steps: Annotated[float, Field(gt=1, le=25)] = 1.75
    """Radius of the neighbourhood, in steps from stripe to stripe: the next stripe planes to either side."""
    smallest_radius_mm: Annotated[float, Field(ge=0, le=50)] = 3.0
    """Lower bound of that radius: if steps are short, noise would tilt the planes of a smaller neighbourhood."""
    grazing: Annotated[float, Field(ge=0, lt=1)] = 0.1
    """Cosine of the angle at a point between its normal and its camera below which its neighbours decide."""
