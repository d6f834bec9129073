"""What a calibration can be told."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from schemas.base.model import Document
from schemas.parameters.extraction import ExtractionParameters

Order = Annotated[int, Field(ge=1, le=5)]
ModelName = Literal["polynomial", "homography", "homography-distortion", "homography-correction"]


class CalibrationParameters(Document):
    """Which model of a camera is fitted."""

    model: Literal["auto", "quadratic", ModelName] = Field(
        default="auto",
        description="auto: the model with the least held-out error; polynomial: orders 1 to 5 in normalised "
        "coordinates; homography: a plane seen by a pinhole; homography-distortion: bent by a lens; "
        "homography-correction: and by what else there is, such as glass; quadratic: second order of the plain pixel "
        "coordinates, with the basic solution where there are fewer points than unknowns (charts only)",
    )
    order: Order | None = Field(
        default=None,
        description="order of the polynomial; left out, the order with the least held-out error is taken",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.order is not None and self.model != "polynomial":
            raise ValueError("order belongs to the model polynomial")
        return self


class PlacementParameters(Document):
    """Where the reference object may have stood."""

    placement_tolerance_mm: Annotated[float, Field(gt=0, le=50)] = Field(
        default=1.0,
        description="distance in mm from where it should stand beyond which the object is wrongly placed; what is less "
        "is put right where the cameras agree on it",
    )


class CaptureCalibrationParameters(CalibrationParameters, PlacementParameters):
    """How a capture of the reference object becomes a calibration."""

    extraction: ExtractionParameters = Field(
        default=ExtractionParameters(largest_width_px=14.0),
        description="how the stripe is found on the object: it is matt, so its stripe is narrow",
    )

    @model_validator(mode="after")
    def _has_enough_data(self) -> Self:
        if self.model == "quadratic":
            raise ValueError("quadratic is for charts, expected polynomial with order 2")
        return self

    @property
    def placement(self) -> PlacementParameters:
        """What judges the placements."""
        return PlacementParameters(placement_tolerance_mm=self.placement_tolerance_mm)

    @property
    def fit(self) -> CalibrationParameters:
        """What chooses the model of a camera."""
        return CalibrationParameters(model=self.model, order=self.order)
