"""Parameters of mapping stripe points to the world."""

from typing import Annotated

from pydantic import Field

from schemas.base.model import Document


class MappingParameters(Document):
    """Limits within which a calibration is trusted."""

    margin_px: Annotated[float, Field(ge=0, le=10_000)] = 20.0
    """Distance outside the region of the control points up to which the calibration supports a pixel."""
    extrapolation_mm: Annotated[float, Field(ge=0, le=100)] = 0.1
    """Farther outside, a pixel is supported if the calibration predicts at most this standard deviation. The prediction
    grows slowly for a good map and at once for a bad one."""
