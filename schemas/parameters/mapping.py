"""Parameters of mapping stripe points to the world."""

from typing import Annotated

from pydantic import Field

from schemas.base.model import Document


class MappingParameters(Document):
    """How far a calibration is trusted."""

    margin_px: Annotated[float, Field(ge=0, le=640)] = 20.0
    """How far outside the region of the control points a pixel still counts as supported by the calibration."""
    extrapolation_mm: Annotated[float, Field(ge=0, le=100)] = 0.1
    """Farther outside a pixel is supported where the calibration's covariance predicts a standard deviation of no more:
    that of a good map grows slowly, that of a bad one at once."""
