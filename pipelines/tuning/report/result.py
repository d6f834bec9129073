"""What a search for parameters came to, as its page and its tables show it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, stdev
from typing import Any

import numpy as np
from numpy.typing import NDArray

from footscan.frames.image import Rgb


@dataclass(frozen=True)
class Goal:
    """An objective, and what stands for it."""

    name: str
    unit: str
    meaning: str
    larger_is_better: bool = False


@dataclass(frozen=True)
class Trial:
    """A set of parameters that was tried."""

    number: int
    """From 1; 0 is what the workflow has at present."""
    point: Mapping[str, Any]
    """The values of what is sought."""
    values: Mapping[str, float]
    """Mean over the data sets, by goal; the worst that there is counts for those that failed."""
    of_sets: Mapping[str, Mapping[str, float | None]]
    """By goal, the value of each data set (a scan, or a foot that was scanned more than once); None where it failed."""
    problems: Mapping[str, str]
    """Why scans failed, by scan."""
    on_front: bool = False
    """Whether no other is as good in all and better in something."""


@dataclass(frozen=True)
class Gain:
    """The winner beside the present parameters, by one goal."""

    goal: Goal
    sets: Mapping[str, tuple[float | None, float | None]]
    """Present and winner's value of each data set; None where that failed."""

    @property
    def both(self) -> list[tuple[float, float]]:
        """The values of the data sets on which neither failed."""
        return [(a, b) for a, b in self.sets.values() if a is not None and b is not None]

    @property
    def failed(self) -> tuple[int, int]:
        """On how many data sets the present parameters fail, and the winner."""
        present, winner = zip(*self.sets.values(), strict=True)
        return present.count(None), winner.count(None)

    @property
    def means(self) -> tuple[float | None, float | None]:
        """Present and winner's value over the data sets on which neither failed, or else over those of each."""
        columns = zip(*(self.both or self.sets.values()), strict=True)
        known = [[value for value in column if value is not None] for column in columns]
        present, winner = (fmean(values) if values else None for values in known)
        return present, winner

    @property
    def mean(self) -> float | None:
        """By how much the winner is better over those; negative where it is worse."""
        return fmean(self._by) if self.both else None

    @property
    def spread(self) -> float | None:
        """Standard deviation of that between the data sets; None of a single one."""
        return stdev(self._by) if len(self.both) > 1 else None

    @property
    def improved(self) -> int:
        """On how many data sets the winner is better."""
        return sum(better > 0 for better in self._by)

    @property
    def verdict(self) -> str:
        """In a word whether to believe in it."""
        before, after = self.failed
        if before != after:
            return "fails less" if after < before else "fails more"
        if not self.mean:
            return "none"
        if self.spread is None:
            return "unproven"
        if abs(self.mean) <= self.spread:
            return "within the spread"
        return "real" if self.mean > 0 else "real loss"

    @property
    def _by(self) -> list[float]:
        sign = 1 if self.goal.larger_is_better else -1
        return [sign * (b - a) for a, b in self.both]


@dataclass(frozen=True)
class FrameChange:
    """A frame in which the winner finds other points than the present parameters."""

    scan: str
    camera: int
    frame: int
    image: Rgb
    present: NDArray[np.float64]
    """(N, 2) columns and rows of the points that the present parameters keep, px."""
    winner: NDArray[np.float64]
    """(M, 2)"""


@dataclass(frozen=True)
class TuneResult:
    """What a search came to."""

    goals: Sequence[Goal]
    sampler: str
    notes: Sequence[str]
    """What a reader must know to judge it."""
    trials: Sequence[Trial]
    """The present parameters first."""
    winner: Trial
    gains: Sequence[Gain]
    """On the data sets that decided."""
    held_out: Sequence[Gain]
    """On those that did not; empty where none was held out."""
    changes: Sequence[FrameChange]
