"""Sets of parameters: how they override those of a workflow, and grids of them."""

import math
from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any

from schemas.base.errors import RefusedInput
from schemas.base.model import canonical_json
from schemas.base.overrides import overridden
from schemas.parameters.scan import ScanParameters
from schemas.tuning import SearchRange, Tuning, is_whole

Point = dict[str, Any]
"""Value of each searched parameter, by `section.name`."""
LARGEST_GRID = 10_000
"""Most points of a grid: a bound of time."""
DIGITS = 4
"""Significant digits of a real value that a sampler proposes: readable, and finer than any film can resolve."""


def with_point(parameters: ScanParameters, point: Mapping[str, Any]) -> ScanParameters:
    """`parameters` with the values of `point`; RefusedInput if they contradict each other."""
    settings = [f"{name}={value if isinstance(value, str) else canonical_json(value)}" for name, value in point.items()]
    try:
        return overridden(ScanParameters, parameters.model_dump(mode="json", exclude_unset=True), settings)
    except RefusedInput as error:
        raise RefusedInput(error.field or "parameters", error.problem) from None


def present_point(parameters: ScanParameters, tuning: Tuning) -> Point:
    """The present values of the searched parameters."""
    values = parameters.model_dump(mode="json")
    return {name: values[name.partition(".")[0]][name.partition(".")[2]] for name in tuning.search}


def grid(tuning: Tuning) -> Iterator[Point]:
    """All combinations; the last parameter varies fastest. RefusedInput if there are too many."""
    axes = {name: grid_values(name, tried) for name, tried in tuning.search.items()}
    if (count := math.prod(map(len, axes.values()))) > LARGEST_GRID:
        raise RefusedInput("tune.search", f"is a grid of {count} points, expected at most {LARGEST_GRID}")
    return (dict(zip(axes, values, strict=True)) for values in product(*axes.values()))


def grid_values(name: str, tried: SearchRange | list[Any]) -> list[Any]:
    """Values of one parameter in a grid."""
    if isinstance(tried, list):
        return tried
    if tried.step is None and not is_whole(name):
        raise RefusedInput(f"tune.search.{name}", "is a range without a step, expected a step or a list for a grid")
    step = tried.step or 1.0
    count = math.floor((tried.high - tried.low) / step * (1 + 1e-12)) + 1
    if count > LARGEST_GRID:
        raise RefusedInput(f"tune.search.{name}", f"has {count} values, expected at most {LARGEST_GRID} in a grid")
    return [_plain(name, tried.low + k * step, tried) for k in range(count)]


def plain(point: Point, tuning: Tuning) -> Point:
    """Round the real values of a proposed point to `DIGITS`."""
    return {name: _plain(name, value, tuning.search[name]) for name, value in point.items()}


def _plain(name: str, value: Any, tried: SearchRange | list[Any]) -> Any:
    if isinstance(tried, list):
        return value
    return int(value) if is_whole(name) else min(max(float(f"{value:.{DIGITS}g}"), tried.low), tried.high)
