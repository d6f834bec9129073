"""What the calibration from a chart can be told."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from schemas.documents import Document

Order = Annotated[int, Field(ge=1, le=5)]


class ChartCalibrationParameters(Document):
    """Calibration from control points whose pixels are known."""

    model: Literal["polynomial", "quadratic"] = Field(
        default="polynomial",
        description="polynomial: orders 1 to 5 in normalised coordinates; quadratic: second order of the plain pixel "
        "coordinates, with the basic solution where there are fewer points than unknowns",
    )
    order: Order | None = Field(
        default=None,
        description="order of the polynomial; left out, the order with the least held-out error is taken",
    )
    highest_order: Order = Field(default=5, description="the highest order that is tried")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.order is not None and self.model == "quadratic":
            raise ValueError("order belongs to the model polynomial, the quadratic model has order 2")
        return self
