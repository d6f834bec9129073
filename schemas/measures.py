"""measures.json: a foot's measures, each with its unit, its definition and whether it could be taken."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from schemas.base.model import Document, Side

Unit = Literal["mm", "mm2", "mm3", "deg", "1"]
Status = Literal["ok", "uncertain", "incomplete"]
Place = tuple[float, float, float]


class Measure(Document):
    """One measure."""

    value: float | None
    """None where it cannot be told."""
    unit: Unit
    status: Status
    """"uncertain" has a value that rests on a fallback or on filled surface; "incomplete" has none, and a note that
    says why."""
    definition: str
    note: str | None = None
    uncertainty: float | None = None
    """Standard deviation that comes from the errors of the mesh, in the unit of the value; None where that is not
    known."""
    surface_length: float | None = None
    """Of a girth: the length along the surface, hollows included, mm; the value is that of a tape, which bridges
    them."""
    plane: tuple[Place, Place] | None = None
    """Of a girth, a point in mm and the unit normal of the plane in which it was taken, frame of the mesh."""
    filled_share: float | None = None
    """How far the value rests on surface that was filled and not measured, from 0 to 1; None where the mesh does not
    tell."""
    calibration: tuple[float, float] | None = None
    """(a, b), where the value is a + b times what was measured; None where it is what was measured."""

    @model_validator(mode="after")
    def _value_unless_incomplete(self) -> Self:
        if (self.value is None) != (self.status == "incomplete"):
            raise ValueError(f"status {self.status!r} with value {self.value}, expected no value for 'incomplete' only")
        return self


Axis = Literal["toe2", "ball_center", "brannock"]


class MeasuredLandmark(Document):
    """Where a landmark is, and how it was found."""

    point: Place
    """mm, frame of the mesh"""
    method: Literal["geometric", "fallback", "manual"]
    confidence: float = Field(ge=0, le=1)
    note: str | None = None


class Measures(Document):
    """The content of measures.json."""

    format: Literal["footscan.measures/1"] = "footscan.measures/1"
    unit: Literal["mm"] = "mm"
    side: Side
    side_note: str | None = None
    """Where the form of the foot speaks against the side."""
    axis: Axis | None
    """The foot axis that lengths run along: from the rearmost heel point to the tip of the second toe ("toe2") or to
    the middle of the ball, or along the tangent of heel and ball on the medial side; None where nothing could be
    measured."""
    transform: Annotated[list[list[float]], Field(min_length=4, max_length=4)]
    """4 x 4, from the scanner's frame to the foot's own: mm, +X from heel to toes along the axis, Z up, origin on the
    floor below the rearmost heel point; left feet mirrored into right ones, so that +Y is medial."""
    measures: dict[str, Measure]
    landmarks: dict[str, MeasuredLandmark] = Field(default_factory=dict)
    finding: str | None = None
    """Why nothing could be measured, where that is so: the surface is no foot."""
