"""The table that sizes, widths and lasts are chosen by, and what it says of a foot."""

from fractions import Fraction
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from schemas.base.model import Document, Side
from schemas.lasts import LastRules

People = Literal["men", "women", "children"]
Confidence = Literal["published", "recalled", "fitted", "chosen"]
"""Found in a published source; remembered of a standard, but not checked; fitted to figures; a default of our own."""


def _fraction(value: Any) -> Any:
    """A fraction such as `25.4/3` as a number: barleycorns and Paris points have no short decimals."""
    if not isinstance(value, str) or value.count("/") != 1:
        return value
    above, below = value.split("/")
    try:
        return float(Fraction(above.strip()) / Fraction(below.strip()))
    except (ValueError, ZeroDivisionError):
        raise ValueError("expected a number or a fraction such as 25.4/3") from None


Number = Annotated[float, BeforeValidator(_fraction), Field(ge=-1e6, le=1e6)]
Positive = Annotated[float, BeforeValidator(_fraction), Field(ge=1e-3, le=1e6)]


class Sourced(Document):
    """Figures that somebody must answer for."""

    source: Annotated[str, Field(min_length=1)]
    confidence: Confidence


class Restart(Document):
    """Where the counting starts again: after 13.5 comes 1."""

    after: Number
    by: Number


class SizeScale(Sourced):
    """A system of sizes: size = (foot length + allowance_mm) / unit_mm - zero."""

    label: str
    people: Annotated[list[People], Field(min_length=1)]
    unit_mm: Positive
    """Of one whole size."""
    allowance_mm: Number = 0.0
    """The last is longer than the foot by this."""
    zero: Number = 0.0
    """Sizes below which the counting starts."""
    step: Positive
    up_beyond: Annotated[float, BeforeValidator(_fraction), Field(ge=0, le=1e6)]
    """The next step is taken where more than this is left over; half a step rounds to the nearest."""
    smallest: Number
    largest: Number
    """On the running scale."""
    restart: Restart | None = None
    arch_rule: bool = False
    """Whether the size by the ball length wins where it is the larger one."""
    breadth_step_mm: Positive | None = None
    """Where given, the foot's breadth follows after a slash, in steps of this."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.smallest >= self.largest:
            raise ValueError(f"largest is {self.largest:g}, expected more than smallest, {self.smallest:g}")
        if self.up_beyond >= self.step:
            raise ValueError(f"up_beyond is {self.up_beyond:g}, expected less than step, {self.step:g}")
        return self


class WidthScale(Sourced):
    """A system of widths: each stands `step_mm` above the one before it, and all slide with the foot's length."""

    label: str
    people: Annotated[list[People], Field(min_length=1)]
    measure: Literal["foot_breadth", "ball_girth"]
    allowance_mm: Number = 0.0
    """Added to the foot's, where the scale is one of lasts."""
    names: Annotated[list[str], Field(min_length=1)]
    """From narrow to wide."""
    middle: str
    middle_mm: Number
    """What `middle` stands for at `at_length_mm`."""
    at_length_mm: Positive
    per_mm: Number
    """Growth with a mm of foot length."""
    step_mm: Positive
    shortest_mm: Positive
    longest_mm: Positive
    """Foot lengths that there are shoes of these widths for."""
    standard: str | None = None
    """Which widths shops stock."""

    @model_validator(mode="after")
    def _middle_is_named(self) -> Self:
        if self.names.count(self.middle) != 1 or len(set(self.names)) < len(self.names):
            raise ValueError(f"expected names that differ, among them middle, {self.middle!r}, once")
        return self


class ArchRule(Sourced):
    """The rule of the Brannock device: the longer of foot and arch decides."""

    ball_share: Annotated[float, BeforeValidator(_fraction), Field(ge=0.5, le=1)]
    """Of the foot length, what the ball length is in the foot that shoes are made for."""
    from_sizes: Annotated[float, BeforeValidator(_fraction), Field(ge=0, le=1e6)]
    """The arch decides from this many sizes above the toes on."""


class Repeatability(Sourced):
    """Scatter of one foot's measures from scan to scan, placed anew: one standard deviation."""

    lengths_mm: Positive | None
    girths_mm: Positive | None


class Asymmetry(Sourced):
    """Standard deviation, over people, of right minus left."""

    sd_mm: dict[str, Positive]
    unusual_beyond: Positive
    """Differences of more standard deviations are reported."""


class SizeTable(Document):
    """The content of a table of sizes."""

    format: Literal["footscan.sizes/1"]
    arch: ArchRule
    sizes: Annotated[dict[str, SizeScale], Field(min_length=1)]
    widths: dict[str, WidthScale]
    repeatability: Repeatability
    left_right: Asymmetry
    lasts: LastRules


class FoundSize(Document):
    """A size in one system."""

    system: str
    label: str
    people: list[People]
    size: str | None
    """As it is marked; None where there is none, and `note` says why."""
    unrounded: float | None
    rounding: str
    decided_by: Literal["foot_length", "ball_length"] | None
    note: str | None
    source: str
    confidence: Confidence


class FoundWidth(Document):
    """A width in one system."""

    system: str
    label: str
    people: list[People]
    width: str | None
    steps: float | None
    """Unrounded, from `middle`."""
    middle: str
    measure: str
    standard: str | None
    note: str | None
    source: str
    confidence: Confidence


class Sizes(Document):
    """What shoes a foot, or a pair of them, takes."""

    measures_mm: dict[str, float | None]
    """What was decided by."""
    sizes: list[FoundSize]
    widths: list[FoundWidth]
    caution: str = "for reference only: makers deviate from these scales by up to a size"


class FootSizes(Sizes):
    """The content of sizes.json."""

    format: Literal["footscan.foot_sizes/1"]
    side: Side
    people: People | None
    """Whose scales these are; None for all."""
