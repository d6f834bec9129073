"""Lasts: what is measured of them, by which rules they are chosen, and how they rank for a foot."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from schemas.base.model import Document, Side

LastMeasure = Literal["length", "ball_length", "ball_girth", "waist_girth", "instep_girth", "heel_girth"]
"""`length` is the functional one, without what the style adds at the toes."""
LastSide = Literal["left", "right", "both"]
Number = Annotated[float, Field(ge=-1000, le=1000)]


class Allowance(Document):
    """How much larger than the foot a last may be; smaller where negative."""

    from_mm: Number
    to_mm: Number
    weight: Annotated[float, Field(ge=0, le=1000)] = 1.0
    """Of a square mm beyond."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.from_mm > self.to_mm:
            raise ValueError(f"to_mm is {self.to_mm:g}, expected at least from_mm, {self.from_mm:g}")
        return self


class LastRules(Document):
    """By what a last is chosen."""

    purposes: Annotated[dict[str, dict[LastMeasure, Allowance]], Field(min_length=1)]
    reject_below_mm: dict[LastMeasure, Number]
    """A last that is not at least this much larger than the foot is out, whatever else fits."""
    source: str
    confidence: Literal["published", "recalled", "fitted", "chosen"]


class Last(Document):
    """One last, as a row of a table has it; mm."""

    name: str
    article: str | None = None
    size: str | None = None
    fullness: str | None = None
    side: LastSide = "both"
    heel_height_mm: float | None = None
    toe_spring_mm: float | None = None
    measures: dict[LastMeasure, float]
    place: str
    """File and line."""


class Deviation(Document):
    """One measure of a last beside the foot's; mm."""

    last: float
    foot: float
    difference: float
    """Last minus foot."""
    outside: float
    """How far that lies outside what the purpose allows: above where positive, below where negative."""


class LastFit(Document):
    """A last beside one foot."""

    last: Last
    mirrored: bool
    """Whether the last is one of the other side."""
    deviations: dict[LastMeasure, Deviation]
    not_compared: list[LastMeasure]
    """Measures of the purpose that foot or last lack."""
    score: float
    """Sum of weight times square of what lies outside, mm2: 0 where all is as wished."""
    distance: float
    """The same from the middle of what is allowed: it orders lasts that fit alike."""
    rejected: list[str]
    """Why it is out."""


class RankedLast(Document):
    """A last beside all feet that it is for."""

    name: str
    rank: int | None
    """From 1; None where it is out."""
    score: float
    """Of the foot that it fits worse."""
    worse: str
    """That foot."""
    feet: dict[str, LastFit]
    """By side; `foot` where that is unknown."""


class Ranking(Document):
    """Lasts in the order of their fit."""

    purpose: str
    sides: list[Side]
    missing: list[str]
    """Measures that a foot lacks, each with the reason."""
    lasts: list[RankedLast]
