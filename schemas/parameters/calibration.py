"""Parameters of a calibration."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from schemas.base.model import Document
from schemas.parameters.extraction import ExtractionParameters

Order = Annotated[int, Field(ge=1, le=5)]
ModelName = Literal["polynomial", "homography", "homography-distortion", "homography-correction"]


class CalibrationParameters(Document):
    """The model that is fitted to each camera."""

    model: Literal["auto", "quadratic", ModelName] = Field(
        default="auto",
        description="auto: the model with the least held-out error; polynomial: orders 1 to 5 in normalised "
        "coordinates; homography: a plane seen by a pinhole; homography-distortion: bent by a lens; "
        "homography-correction: and corrected for the rest, such as glass; quadratic: second order of the plain pixel "
        "coordinates, with the basic solution where there are fewer points than unknowns (charts only)",
    )
    order: Order | None = Field(
        default=None,
        description="order of the polynomial; default: the order with the least held-out error",
    )

    points: Annotated[int, Field(ge=4, le=2000)] | None = Field(
        default=None,
        description="control points of each camera that are used, the most spread ones; default: all (charts only)",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.order is not None and self.model != "polynomial":
            raise ValueError("order belongs to the model polynomial")
        return self


class PlacementParameters(Document):
    """The tolerance for the placements of the reference object."""

    placement_tolerance_mm: Annotated[float, Field(gt=0, le=50)] = Field(
        default=1.0,
        description="distance in mm from its nominal place beyond which the object is wrongly placed; a smaller error "
        "is corrected if the cameras agree on it",
    )


class CaptureCalibrationParameters(CalibrationParameters, PlacementParameters):
    """Parameters of a calibration from a capture of the reference object."""

    extraction: ExtractionParameters = Field(
        default=ExtractionParameters(largest_width_px=14.0),
        description="extraction of the stripe on the object, which is matt, so that its stripe is narrow",
    )

    @model_validator(mode="after")
    def _has_enough_data(self) -> Self:
        if self.model == "quadratic":
            raise ValueError("quadratic is for charts, expected polynomial with order 2")
        if self.points is not None:
            raise ValueError("points is for charts, expected none")
        return self

    @property
    def placement(self) -> PlacementParameters:
        """The parameters of the placements alone."""
        return PlacementParameters(placement_tolerance_mm=self.placement_tolerance_mm)

    @property
    def fit(self) -> CalibrationParameters:
        """The parameters of the fit of a camera alone."""
        return CalibrationParameters(model=self.model, order=self.order)
