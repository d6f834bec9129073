"""The reference object and the capture of it that a calibration is made from."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from schemas.documents import Document, RelativePath
from schemas.scan import CameraSource, unique_ids

Pair = Annotated[list[float], Field(min_length=2, max_length=2)]


class ReferenceObject(Document):
    """A straight prism along X whose cross-section is known exactly. Its corners are control points."""

    format: Literal["footscan.reference/1"]
    profile_mm: Annotated[list[Pair], Field(min_length=3, max_length=1000)]
    """(Y, Z) of the corners, a closed polygon."""
    placements_mm: Annotated[list[Pair], Field(min_length=1, max_length=10_000)]
    """(dY, dZ) of each placement, one captured frame each."""


class Capture(Document):
    """The content of capture.yaml: frame k of a camera shows placement k."""

    format: Literal["footscan.capture/1"]
    reference: RelativePath
    x_mm: float
    """Where the laser plane stands."""
    cameras: Annotated[list[CameraSource], Field(min_length=1)]

    @model_validator(mode="after")
    def _unique(self) -> Self:
        unique_ids(self.cameras)
        return self
