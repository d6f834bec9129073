"""measures.json: a foot's measures, each with its unit, its definition and whether it could be taken."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from schemas.base.model import Document, Posture, Side

Unit = Literal["mm", "mm2", "mm3", "deg", "1"]
Status = Literal["ok", "uncertain", "incomplete"]
ErrorCause = Literal["noise", "filling", "ends", "cameras", "tremor", "sway", "glass", "landmarks"]
"""Why a measure errs: noise of the stripes and of the surface through them; surface that was filled; ends of the foot
that no stripe shows, or one camera alone; cameras that disagree; tremor of the foot, or heads that do not run evenly;
slow movement of the foot, which heads hardly show; the glass, from which heights count; landmarks on a plateau, which
move with the others."""
Position = tuple[float, float, float]


class Convention(Document):
    """The definition that a measure follows."""

    follows: str
    """Publication and its name for the measure; "footscan" if the definition is our own."""
    iso: str | None = None
    """Names of the measure in ISO standards, if it has one there."""
    iso_differs: str | None = None
    """How the definition differs from that of the ISO standard."""


class Measure(Document):
    """One measure."""

    value: float | None
    """None if it could not be measured."""
    unit: Unit
    status: Status
    """"uncertain" has a value and a note with the reason, such as a fallback, filled surface, a large standard
    deviation or a doubt about the whole scan; "incomplete" has no value, and a note that says why."""
    definition: str
    convention: Convention | None = None
    """The definition that it follows; None in files of earlier versions."""
    note: str | None = None
    uncertainty: float | None = None
    """Standard deviation due to the errors of the mesh, in the unit of the value; None if unknown."""
    budget: dict[ErrorCause, float] | None = None
    """Standard deviation by its cause; the uncertainty is the root of the sum of their squares. None if unknown."""
    surface_length: float | None = None
    """For a girth: the length along the surface in mm, hollows included; the value is that of a tape, which bridges
    them."""
    plane: tuple[Position, Position] | None = None
    """For a girth: a point in mm and the unit normal of its plane, frame of the mesh."""
    filled_share: float | None = None
    """Share of the value that rests on filled instead of measured surface, from 0 to 1; None if unknown."""
    calibration: tuple[float, float] | None = None
    """(a, b) if the value is a + b times the measured value; None if it is the measured value itself."""

    @model_validator(mode="after")
    def _value_unless_incomplete(self) -> Self:
        if (self.value is None) != (self.status == "incomplete"):
            raise ValueError(f"status {self.status!r} with value {self.value}, expected no value for 'incomplete' only")
        return self


Axis = Literal["toe2", "ball_center", "brannock"]


class MeasuredLandmark(Document):
    """The place of a landmark, and the method that found it."""

    point: Position
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
    """Warning that the form of the foot contradicts the side."""
    posture: Posture = "unknown"
    """Posture of the person and load on the foot, as scan.yaml has it; lengths and girths depend on it."""
    things: list[str] = Field(default_factory=list)
    """Steps of the surface that no foot has: where something was held at the foot. All measures are uncertain then."""
    doubts: list[str] = Field(default_factory=list)
    """Reasons not to rely on the scanner, a sentence each. All measures are uncertain then."""
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
    """Reason why nothing could be measured, if so: the surface is no foot."""

    @property
    def warnings(self) -> list[str]:
        """What speaks against the surface as a whole, a sentence without a full stop each."""
        return [*([] if self.side_note is None else [self.side_note]), *self.doubts, *self.things]

    def own_note(self, name: str) -> str | None:
        """The note of a measure without the reasons that all measures have in common; None if nothing is left."""
        note = self.measures[name].note or ""
        for reason in (*self.doubts, *self.things):
            note = note.replace(reason, "")
        return "; ".join(part for part in note.split("; ") if part.strip()) or None
