"""Parameters of mapping stripe points to the world."""

from typing import Annotated

from pydantic import Field

from schemas.documents import Document


class MappingParameters(Document):
    """How far a calibration is trusted."""

    margin_px: Annotated[float, Field(ge=0, le=640)] = 20.0
    """How far outside the region of the control points a pixel still counts as supported by the calibration."""
