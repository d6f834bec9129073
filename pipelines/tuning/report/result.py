"""The result of a search for parameters, as shown by its page and its tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, stdev
from typing import Any

import numpy as np
from numpy.typing import NDArray

from footscan.frames.image import Rgb


@dataclass(frozen=True)
class Goal:
    """An objective, and its meaning with the present scans."""

    name: str
    unit: str
    meaning: str
    larger_is_better: bool = False


@dataclass(frozen=True)
class Trial:
    """A set of parameters that was tried."""

    number: int
    """Number from 1; 0 are the present parameters of the workflow."""
    point: Mapping[str, Any]
    """Values of the searched parameters."""
    values: Mapping[str, float]
    """Mean over the data sets, by goal; a failure counts as the worst value."""
    of_sets: Mapping[str, Mapping[str, float | None]]
    """Value of each data set (a scan, or a foot that was scanned more than once), by goal; None for a failure."""
    problems: Mapping[str, str]
    """Why scans failed, by scan."""
    on_front: bool = False
    """True if the trial is on the Pareto front."""


@dataclass(frozen=True)
class Gain:
    """Comparison of the winner with the present parameters, by one goal."""

    goal: Goal
    sets: Mapping[str, tuple[float | None, float | None]]
    """Values of each data set: present and winner; None for a failure."""

    @property
    def both(self) -> list[tuple[float, float]]:
        """Values of the data sets on which neither failed."""
        return [(a, b) for a, b in self.sets.values() if a is not None and b is not None]

    @property
    def failed(self) -> tuple[int, int]:
        """Number of data sets on which the present parameters fail, and the winner."""
        present, winner = zip(*self.sets.values(), strict=True)
        return present.count(None), winner.count(None)

    @property
    def means(self) -> tuple[float | None, float | None]:
        """Mean values, present and winner, over the data sets on which neither failed (if none: each over its own)."""
        columns = zip(*(self.both or self.sets.values()), strict=True)
        succeeded = [[value for value in column if value is not None] for column in columns]
        present, winner = (fmean(values) if values else None for values in succeeded)
        return present, winner

    @property
    def mean(self) -> float | None:
        """Mean gain of the winner over the data sets on which neither failed; negative for a loss."""
        return fmean(self._by) if self.both else None

    @property
    def spread(self) -> float | None:
        """Standard deviation of the gain between the data sets; None for a single data set."""
        return stdev(self._by) if len(self.both) > 1 else None

    @property
    def improved(self) -> int:
        """Number of data sets on which the winner is better."""
        return sum(better > 0 for better in self._by)

    @property
    def verdict(self) -> str:
        """Verdict on the gain in a word or two."""
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
    """A frame in which winner and present parameters keep different points."""

    scan: str
    camera: int
    frame: int
    image: Rgb
    present: NDArray[np.float64]
    """(N, 2) columns and rows, px, of the points kept with the present parameters."""
    winner: NDArray[np.float64]
    """(M, 2) columns and rows, px, of the points kept with the winner."""


@dataclass(frozen=True)
class TuneResult:
    """The result of a search."""

    goals: Sequence[Goal]
    sampler: str
    notes: Sequence[str]
    """Notes that a reader needs to judge the result."""
    trials: Sequence[Trial]
    """All trials; the first is that of the present parameters."""
    winner: Trial
    gains: Sequence[Gain]
    """Gains on the data sets that decided."""
    held_out: Sequence[Gain]
    """Gains on the held-out data sets; empty if none was held out."""
    changes: Sequence[FrameChange]
