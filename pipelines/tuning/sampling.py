"""Proposals of the next set of parameters: a grid, or a sampler of Optuna that learns from the trials before.

A proposal depends only on the search, its seed and the trials before it, even if the search was interrupted: each is
drawn with a random generator of its own, and a continued search replays its earlier trials first.
"""

import json
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from pipelines.engine.files.digest import sha256
from pipelines.tuning.space import Point, grid, grid_values, plain
from schemas.base.model import canonical_json
from schemas.tuning import SearchRange, Tuning, is_whole

if TYPE_CHECKING:
    from optuna.distributions import BaseDistribution
    from optuna.samplers import BaseSampler

POPULATION = 12
"""Population of NSGA-II; with the default of 50, 40 trials would be one random generation. Chosen by hand."""


class Proposals(Protocol):
    """Sets of parameters to try, one after another."""

    def ask(self) -> Point | None:
        """The next set; None if there are no more."""
        ...

    def tell(self, point: Point, values: Sequence[float]) -> None:
        """Report the point that was tried, usually the proposed one, and its values by objective; less is better."""
        ...


def proposals_of(tuning: Tuning, objectives: int) -> Proposals:
    """Return the proposals of a search."""
    return _Grid(grid(tuning)) if tuning.sampler == "grid" else _Sampled(tuning, objectives)


class _Grid:
    """All points of a grid."""

    def __init__(self, points: Iterator[Point]) -> None:
        self._points = points

    def ask(self) -> Point | None:
        return next(self._points, None)

    def tell(self, point: Point, values: Sequence[float]) -> None:
        """Do nothing: a grid does not depend on results."""


class _Sampled:
    """Proposals of a sampler of Optuna.

    The trial that Optuna creates for a proposal is marked as failed, and a trial of the point that was tried is added.
    So the sampler learns and stores the same (NSGA-II its generations), whether its proposal or an earlier point was
    tried.
    """

    def __init__(self, tuning: Tuning, objectives: int) -> None:
        import optuna

        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self._tuning = tuning
        self._distributions = {name: _distribution(name, tried) for name, tried in tuning.search.items()}
        self._lists = {name for name, tried in tuning.search.items() if isinstance(tried, list)}
        self._study = optuna.create_study(directions=["minimize"] * objectives)
        self._asked = 0

    def ask(self) -> Point | None:
        from optuna.trial import TrialState

        self._study.sampler = _sampler(self._tuning, self._asked)
        self._asked += 1
        trial = self._study.ask(self._distributions)
        self._attributes = self._study.get_trials(deepcopy=False)[trial.number].system_attrs
        self._study.tell(trial, state=TrialState.FAIL)
        proposed = {name: json.loads(v) if name in self._lists else v for name, v in trial.params.items()}
        return plain(proposed, self._tuning)

    def tell(self, point: Point, values: Sequence[float]) -> None:
        from optuna.trial import create_trial

        tried = create_trial(
            params={name: canonical_json(v) if name in self._lists else v for name, v in point.items()},
            distributions=self._distributions,
            values=list(values),
            system_attrs=self._attributes,
        )
        self._study.add_trial(tried)


def _sampler(tuning: Tuning, number: int) -> "BaseSampler":
    from optuna.samplers import NSGAIISampler, RandomSampler, TPESampler

    seed = int(sha256(f"{tuning.seed}/{number}".encode())[:8], 16)
    if tuning.sampler == "random":
        return RandomSampler(seed=seed)
    if tuning.sampler == "nsga2":
        return NSGAIISampler(seed=seed, population_size=POPULATION)
    return TPESampler(seed=seed)


def _distribution(name: str, tried: SearchRange | list[Any]) -> "BaseDistribution":
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

    if isinstance(tried, list):
        return CategoricalDistribution([canonical_json(value) for value in tried])
    if is_whole(name):
        step = int(tried.step or 1)
        last = int(tried.low) + int(tried.high - tried.low) // step * step
        return IntDistribution(int(tried.low), last, log=tried.log, step=step)
    if tried.step is None:
        return FloatDistribution(tried.low, tried.high, log=tried.log)
    steps = len(grid_values(name, tried)) - 1
    return FloatDistribution(tried.low, tried.low + steps * tried.step, step=tried.step)
