"""Parameters of the fusion of the cameras."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from schemas.base.model import Document


class FusionParameters(Document):
    """Parameters that turn the points of several cameras into one cloud."""

    method: Literal["merge", "concatenate"] = "merge"
    """`merge` averages what several cameras saw, and settles contradictions; `concatenate` keeps all points of all
    cameras as they are, as the thesis does, for comparison."""
    spacing_mm: Annotated[float, Field(ge=0, le=5)] = 0.4
    """Points of one stripe plane are no closer to each other; 0 keeps all."""
    contradiction_mm: Annotated[float, Field(gt=0, le=10)] = 1.0
    """Points of two cameras that lie farther apart show different surfaces."""
    contradiction_sigmas: Annotated[float, Field(ge=1, le=20)] = 4.0
    """If points are closer, but more than this number of standard deviations apart, they contradict each other: those
    of the majority stay, or the mean of all without one."""
    correct_cameras: bool = True
    """True if a camera may be moved to agree with others on the skin that they all see."""
    overlap_mm: Annotated[float, Field(gt=0, le=20)] = 3.0
    """Largest distance between two cameras' points of the same skin at which they are compared."""
    largest_correction_mm: Annotated[float, Field(gt=0, le=10)] = 1.0
    """A camera that would have to be moved farther is left as it is and reported."""
    smallest_correction_mm: Annotated[float, Field(ge=0, le=10)] = 0.02
    """A camera that would have to be moved less is left as it is."""

    @model_validator(mode="after")
    def _can_be_seen(self) -> Self:
        if self.overlap_mm <= self.largest_correction_mm:
            raise ValueError(
                f"overlap_mm: expected more than largest_correction_mm, {self.largest_correction_mm:g}, "
                f"found {self.overlap_mm:g}"
            )
        return self
