"""measures.json: a foot's measures, each with its unit, its definition and whether it could be taken."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from schemas.documents import Document
from schemas.scan import Side

Unit = Literal["mm", "mm2", "mm3", "deg", "1"]
Status = Literal["ok", "uncertain", "incomplete"]


class Measure(Document):
    """One measure."""

    value: float | None
    """None where it cannot be told."""
    unit: Unit
    status: Status
    """"uncertain" has a value that rests on a fallback; "incomplete" has none, and a note that says why."""
    definition: str
    note: str | None = None

    @model_validator(mode="after")
    def _value_unless_incomplete(self) -> Self:
        if (self.value is None) != (self.status == "incomplete"):
            raise ValueError(f"status {self.status!r} with value {self.value}, expected no value for 'incomplete' only")
        return self


Axis = Literal["toe2", "ball_center"]


class Measures(Document):
    """The content of measures.json."""

    format: Literal["footscan.measures/1"] = "footscan.measures/1"
    unit: Literal["mm"] = "mm"
    side: Side
    axis: Axis | None
    """The foot axis that lengths run along: from the rearmost heel point to the tip of the second toe, or, where toes
    cannot be told apart, to the middle of the ball; None where nothing could be measured."""
    transform: Annotated[list[list[float]], Field(min_length=4, max_length=4)]
    """4 x 4, from the scanner's frame to the foot's own: mm, +X from heel to toes along the axis, Z up, origin on the
    floor below the rearmost heel point; left feet mirrored into right ones, so that +Y is medial."""
    measures: dict[str, Measure]
    finding: str | None = None
    """Why nothing could be measured, where that is so: the surface is no foot."""
