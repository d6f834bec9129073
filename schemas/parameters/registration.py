"""Parameters of a registration."""

from pydantic import Field

from schemas.base.model import Document


class RegistrationParameters(Document):
    """Sampling and inlier distance of the registration of one shape to another."""

    points: int = Field(
        default=10_000,
        ge=500,
        le=200_000,
        description="points of the moving shape, spread evenly over it, that the fine registration takes",
    )
    inlier_mm: float = Field(
        default=1.0,
        gt=0,
        le=100,
        description="distance in mm from the other surface up to which a point counts as an inlier",
    )
