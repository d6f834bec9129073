"""Parameters of the fusion of the cameras."""

from typing import Annotated

from pydantic import Field

from schemas.documents import Document


class FusionParameters(Document):
    """How the points of several cameras become one cloud."""

    cell_mm: Annotated[float, Field(ge=0.05, le=5)] = 0.5
    """Edge of the cells within which the points of one stripe plane are averaged."""
