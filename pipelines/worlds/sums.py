"""The sums of a campaign, and which parameters of the worlds drive which errors."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import spearmanr

from schemas.campaign import WorldKind, WorldOutcome
from schemas.world import World

FEWEST_WORLDS = 20
"""Worlds from which a rank correlation is worth showing. Chosen by hand."""


class Sums(NamedTuple):
    """Counts of worlds, and of errors."""

    worlds: int
    measured: int
    """At least one measure is reported as good."""
    warned: int
    """A warning is given of the scan as a whole."""
    right_measures: int
    """Measures that are reported as good, and are."""
    silent_worlds: int
    silent_errors: int
    """Measures and surfaces that are reported as good and are wrong."""
    refused_rightly: int
    """Nothing is reported as good, and the stripes do not cover a foot."""
    refused_needlessly: int
    crashed: int
    """The program failed; also among those that were refused."""

    def figures(self, kind: WorldKind) -> dict[str, float | None]:
        """Return the sums as figures of a suite."""
        return {f"{kind}.{name}": float(value) for name, value in self._asdict().items()}


def sum_up(outcomes: Sequence[WorldOutcome]) -> Sums:
    """Count the outcomes of a campaign."""
    refused = [outcome for outcome in outcomes if not outcome.is_measured]
    return Sums(
        worlds=len(outcomes),
        measured=len(outcomes) - len(refused),
        warned=sum(bool(outcome.warnings) for outcome in outcomes),
        right_measures=sum(
            measure.status == "ok" and not measure.is_silent
            for outcome in outcomes
            for measure in outcome.measures.values()
        ),
        silent_worlds=sum(bool(outcome.silent_errors) for outcome in outcomes),
        silent_errors=sum(len(outcome.silent_errors) for outcome in outcomes),
        refused_rightly=sum(not outcome.can_be_measured for outcome in refused),
        refused_needlessly=sum(outcome.can_be_measured for outcome in refused),
        crashed=sum(outcome.crashed for outcome in outcomes),
    )


def silent_by_name(outcomes: Sequence[WorldOutcome]) -> dict[str, int]:
    """Count the silent errors by measure, the most frequent first."""
    names = [name for outcome in outcomes for name in outcome.silent_errors]
    return {name: names.count(name) for name in sorted(set(names), key=lambda name: (-names.count(name), name))}


ERRORS = ("silent errors", "not measured", "surface, mean", "cloud beyond 1 mm", "foot_length", "ball_girth")
"""The errors that parameters are set against."""


def drivers(worlds: Sequence[World], outcomes: Sequence[WorldOutcome]) -> dict[str, dict[str, float]]:
    """Return Spearman's rank correlation of each parameter with each of `ERRORS`, the strongest parameter first.

    A choice, such as the colour of the laser, counts as one parameter for each value, 1 where it is chosen. Parameters
    that are the same in all worlds are left out; so are errors of fewer than 20 worlds.
    """
    flat = [numbers_of(world) for world in worlds]
    errors = [_errors(outcome) for outcome in outcomes]
    table: dict[str, dict[str, float]] = {}
    for name in sorted({name for parameters in flat for name in parameters}):
        values = np.array([parameters.get(name, 0.0) for parameters in flat])
        row = {}
        for error in ERRORS:
            known = np.array([of_world.get(error, np.nan) for of_world in errors])
            usable = np.isfinite(known)
            if usable.sum() >= FEWEST_WORLDS and np.ptp(values[usable]) > 0.0 and np.ptp(known[usable]) > 0.0:
                row[error] = float(spearmanr(values[usable], known[usable]).statistic)
        if row:
            table[name] = row
    return dict(sorted(table.items(), key=lambda item: -max(map(abs, item[1].values()))))


def numbers_of(world: World) -> dict[str, float]:
    """Return all parameters of a world as numbers, by name; the size of an error counts, not its sign."""
    numbers: dict[str, float] = {}

    def add(name: str, value: object) -> None:
        if isinstance(value, Mapping):
            for key, inner in value.items():
                add(f"{name}.{key}" if name else str(key), inner)
        elif isinstance(value, bool | int | float):
            numbers[name] = abs(float(value))
        elif isinstance(value, str):
            numbers[f"{name} = {value}"] = 1.0
        elif isinstance(value, list | tuple):
            numbers[f"{name}, number"] = float(len(value))

    content = world.model_dump(mode="json", exclude={"format", "seed", "heads"})
    heads = [head.model_dump(mode="json") for head in world.heads]
    content["heads"] = {f"largest {name}": max(abs(head[name]) for head in heads) for name in heads[0]}
    offsets = [head["offset_mm"] for head in heads]
    content["heads"]["spread of offset_mm"] = max(offsets) - min(offsets)
    add("", content)
    numbers.pop("subject.shape_seed", None)
    return numbers


def _errors(outcome: WorldOutcome) -> dict[str, float]:
    errors = {"silent errors": float(len(outcome.silent_errors)), "not measured": float(not outcome.is_measured)}
    if outcome.surface is not None:
        errors["surface, mean"] = outcome.surface.mean
    if outcome.cloud is not None:
        errors["cloud beyond 1 mm"] = outcome.cloud.beyond_1mm
    for name in ("foot_length", "ball_girth"):
        measure = outcome.measures.get(name)
        if measure is not None and measure.error is not None:
            errors[name] = abs(measure.error)
    return errors
