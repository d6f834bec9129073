"""Sets of parameters: how one is laid over those of a workflow, and a grid of them."""

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
"""A value of each parameter that is sought, by `section.name`."""
LARGEST_GRID = 10_000
DIGITS = 4
"""Of a real value that a sampler proposes: so people can read it, and no film shows the difference."""


def with_point(parameters: ScanParameters, point: Mapping[str, Any]) -> ScanParameters:
    """`parameters` with the values of `point`; RefusedInput where they contradict each other."""
    settings = [f"{name}={value if isinstance(value, str) else canonical_json(value)}" for name, value in point.items()]
    try:
        return overridden(ScanParameters, parameters.model_dump(mode="json", exclude_unset=True), settings)
    except RefusedInput as error:
        raise RefusedInput(error.field or "parameters", error.problem) from None


def present_point(parameters: ScanParameters, tuning: Tuning) -> Point:
    """The values that `parameters` have of what is sought."""
    values = parameters.model_dump(mode="json")
    return {name: values[name.partition(".")[0]][name.partition(".")[2]] for name in tuning.search}


def grid(tuning: Tuning) -> Iterator[Point]:
    """Every combination, the last parameter's values running fastest; RefusedInput where there are too many."""
    axes = {name: grid_values(name, tried) for name, tried in tuning.search.items()}
    if (count := math.prod(map(len, axes.values()))) > LARGEST_GRID:
        raise RefusedInput("tune.search", f"is a grid of {count} points, expected at most {LARGEST_GRID}")
    return (dict(zip(axes, values, strict=True)) for values in product(*axes.values()))


def grid_values(name: str, tried: SearchRange | list[Any]) -> list[Any]:
    """What a grid tries of one parameter."""
    if isinstance(tried, list):
        return tried
    if tried.step is None and not is_whole(name):
        raise RefusedInput(f"tune.search.{name}", "is a range without a step, expected one, or a list, for a grid")
    step = tried.step or 1.0
    count = math.floor((tried.high - tried.low) / step * (1 + 1e-12)) + 1
    if count > LARGEST_GRID:
        raise RefusedInput(f"tune.search.{name}", f"has {count} values, expected at most {LARGEST_GRID} in a grid")
    return [_plain(name, tried.low + k * step, tried) for k in range(count)]


def plain(point: Point, tuning: Tuning) -> Point:
    """A proposed point as it is tried: real numbers have few digits."""
    return {name: _plain(name, value, tuning.search[name]) for name, value in point.items()}


def _plain(name: str, value: Any, tried: SearchRange | list[Any]) -> Any:
    if isinstance(tried, list):
        return value
    return int(value) if is_whole(name) else min(max(float(f"{value:.{DIGITS}g}"), tried.low), tried.high)
