"""The result of a night compared with the accepted baseline, as shown by its page and its JUnit file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Literal

Verdict = Literal["better", "same", "worse", "missing", "new"]
VERDICTS: tuple[Verdict, ...] = ("worse", "missing", "new", "better", "same")
"""Verdicts in the order of the page: the most urgent first."""


@dataclass(frozen=True)
class JudgedFigure:
    """A figure of the last night beside the accepted one."""

    name: str
    """Such as `accuracy.mean_mm`."""
    value: float | None
    accepted: float | None
    allowed: float
    """Tolerance."""
    better: str
    """`less`, `more`, `nearer` or `same`."""
    truth: float | None
    """The true value, for a figure that is better the nearer it is to it."""
    verdict: Verdict
    history: Sequence[float | None] = ()
    """Value of each night shown, the last night last; None if a night lacks the figure."""


@dataclass(frozen=True)
class Change:
    """A changed input of a step: code, parameter, library or data."""

    text: str
    """`code of footscan.cloud.fuse changed`"""
    lines: Sequence[tuple[str, str]] = ()
    """Old and new lines side by side: those that differ, with their context."""


@dataclass(frozen=True)
class FirstStep:
    """A step at which the difference begins."""

    steps: Sequence[str]
    """Steps of one kind, such as those of several cameras: `extract-1`."""
    why: str
    """`its result differs`, `no longer exists`, `takes longer`..."""
    changes: Sequence[Change] = ()
    """Changes since the last good night or the baseline; empty if unknown."""


@dataclass(frozen=True)
class JudgedSet:
    """A data set of the suite."""

    name: str
    problem: str | None
    """Why the set could not be run to its end."""
    figures: Sequence[JudgedFigure]
    first: Sequence[FirstStep] = ()
    changed_steps: int = 0
    """Number of steps whose result differs from the accepted one."""
    pictures: Mapping[str, bytes] = field(default_factory=dict)
    """PNG by caption: distances of the present shape to the accepted one, or to that of the last good night."""
    note: str | None = None
    """Why expected pictures are missing."""

    def count(self, *verdicts: Verdict) -> int:
        """Count the figures with one of these verdicts."""
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
    """The result of a night."""

    suite: str
    time: datetime
    software: str
    sets: Sequence[JudgedSet]
    accepted: Sequence[Accepted]
    """The latest entry first; empty if nothing was accepted yet."""
    nights: Sequence[datetime]
    """Ends of the nights whose figures are shown, this one last."""
    notes: Sequence[str] = ()
    """What a reader must know: nights that did not end, gaps, damaged lines of the history."""
    host: str = ""

    def count(self, *verdicts: Verdict) -> int:
        """Count the figures of all sets with one of these verdicts."""
        return sum(judged_set.count(*verdicts) for judged_set in self.sets)
