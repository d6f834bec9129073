"""What a night came to beside the accepted baseline, as its page and its JUnit file show it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Literal

Verdict = Literal["better", "same", "worse", "missing", "new"]
VERDICTS: tuple[Verdict, ...] = ("worse", "missing", "new", "better", "same")
"""What needs a look, first."""


@dataclass(frozen=True)
class JudgedFigure:
    """A figure of last night beside the accepted one."""

    name: str
    """Such as `accuracy.mean_mm`."""
    value: float | None
    accepted: float | None
    allowed: float
    """By how much it may differ."""
    better: str
    """`less`, `more`, `nearer` or `same`."""
    truth: float | None
    """What is known to be right, of what is better the nearer it is."""
    verdict: Verdict
    history: Sequence[float | None] = ()
    """Of each night shown, the last one last; None where there was none."""


@dataclass(frozen=True)
class Change:
    """Something that a step takes, and that is not what it was."""

    text: str
    """`code of footscan.cloud.fuse changed`"""
    lines: Sequence[tuple[str, str]] = ()
    """Old and new side by side, those that differ with some around them."""


@dataclass(frozen=True)
class FirstStep:
    """Where the difference begins."""

    steps: Sequence[str]
    """Steps of one kind, such as those of several cameras: `extract-1`."""
    why: str
    """`its result is another`, `is no more`, `takes longer`..."""
    changes: Sequence[Change] = ()
    """What is not as it was in the last good night, or when the baseline was accepted; empty where it is not known."""


@dataclass(frozen=True)
class JudgedSet:
    """A data set of the suite."""

    name: str
    problem: str | None
    """Why it could not be run to its end."""
    figures: Sequence[JudgedFigure]
    first: Sequence[FirstStep] = ()
    otherwise: int = 0
    """Steps whose result is not the accepted one."""
    pictures: Mapping[str, bytes] = field(default_factory=dict)
    """PNG by caption: how far the present shape lies from the accepted one, or from that of the last good night."""
    note: str | None = None
    """Why there are no pictures, where there should be some."""

    def count(self, *verdicts: Verdict) -> int:
        """How many figures have one of these verdicts."""
        return sum(figure.verdict in verdicts for figure in self.figures)


@dataclass(frozen=True)
class Accepted:
    """An entry of the baseline's history."""

    reason: str
    date: datetime
    by: str
    software: str


@dataclass(frozen=True)
class NightResult:
    """A night."""

    suite: str
    time: datetime
    software: str
    sets: Sequence[JudgedSet]
    accepted: Sequence[Accepted]
    """The last one first; empty where nothing was accepted yet."""
    nights: Sequence[datetime]
    """Ends of the nights whose figures are shown, this one last."""
    notes: Sequence[str] = ()
    """What a reader must know: nights that did not end, gaps, damaged lines of the history."""
    host: str = ""

    def count(self, *verdicts: Verdict) -> int:
        """How many figures of all sets have one of these verdicts."""
        return sum(one.count(*verdicts) for one in self.sets)
