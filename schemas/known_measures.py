"""known.json: the measures of a virtual foot, beside its scan, to compare with what is measured."""

from typing import Annotated, Literal

from pydantic import Field

from schemas.base.model import Document, Side


class KnownMeasures(Document):
    """Measures that are known from how a virtual foot was made; no step of a reconstruction reads them."""

    format: Literal["footscan.known/1"] = "footscan.known/1"
    unit: Literal["mm"] = "mm"
    side: Side
    measures: dict[Annotated[str, Field(max_length=64)], Annotated[float, Field(ge=0, le=10_000)]]
    """By the names of measures.json, in mm; ratios have no unit."""
