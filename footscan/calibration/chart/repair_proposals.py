"""What a person may have meant to type: the small changes of one control point that make it fit with the others."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chart.chart import Chart
from footscan.calibration.chart.plane_fit import fit_homographies, misfits, plausible_misfits, project
from schemas.base.units import MILLIMETRES

Floats = NDArray[np.float64]
Values = tuple[float, float, float, float]
"""Y and Z in the chart's own unit, i and j."""

LARGEST_DIGITS = 8
"""Longer numbers are not typed by hand."""


@dataclass(frozen=True)
class Repair:
    """Another reading of one control point."""

    words: str
    surprise: int
    """0 for one slip of the mind (swapped, a sign, a decimal point), 1 for a coordinate that other points have, 2 for
    one slip of a finger."""
    values: Values


@dataclass(frozen=True)
class Found:
    """A repair that fits."""

    point: int
    repair: Repair
    misfit_px: float


def fitting_repairs(
    chart: Chart, point: int, others: NDArray[np.intp], known: Sequence[Sequence[float]], limit_px: float
) -> list[Found]:
    """The repairs of one point that bring its misfit below `limit_px`, the least surprising and best one first.

    `point` is an index, `others` are those of the points that it has to fit with, and `known` holds the values of Y and
    of Z that occur in the charts.
    """
    repairs = list(_repairs(_values(chart, point), known, chart.unit))
    if not repairs:
        return []
    changed = np.array([repair.values for repair in repairs]).reshape(-1, 4)
    scale = MILLIMETRES[chart.unit]
    kept = np.broadcast_to(np.column_stack([scale * chart.world[others, 1:], chart.pixels[others]]),
                           (len(repairs), len(others), 4))  # fmt: skip
    own = np.concatenate([scale * changed[:, :2], changed[:, 2:]], axis=1)
    together = np.concatenate([kept, own[:, np.newaxis]], axis=1)
    without = float(np.sum(misfits(kept[:1, :, :2], kept[:1, :, 2:]) ** 2))
    misfit = plausible_misfits(together[:, :, :2], together[:, :, 2:])
    added = np.sqrt(np.clip(misfit**2 - without, 0.0, None))
    found = [Found(point, repairs[k], float(added[k])) for k in np.flatnonzero(added <= limit_px)]
    return sorted(found, key=lambda one: (one.repair.surprise, one.misfit_px))


def place_of(chart: Chart, point: int, others: NDArray[np.intp]) -> Floats:
    """The pixel (2,) at which the other points place a point."""
    world = MILLIMETRES[chart.unit] * chart.world[:, 1:]
    homography = fit_homographies(world[np.newaxis, others], chart.pixels[np.newaxis, others])
    return np.asarray(project(homography, world[np.newaxis, [point]])[0, 0])


def _values(chart: Chart, point: int) -> Values:
    (_, y, z), (i, j) = chart.world[point].tolist(), chart.pixels[point].tolist()
    return y, z, i, j


def _repairs(values: Values, known: Sequence[Sequence[float]], unit: str) -> Iterator[Repair]:
    names = (f"y_{unit}", f"z_{unit}", "i", "j")
    y, z, i, j = values
    seen = {values}

    def changed(words: str, surprise: int, new: Values) -> Iterator[Repair]:
        if new not in seen and max(map(abs, new)) < 1e6:
            seen.add(new)
            yield Repair(words, surprise, new)

    def single(column: int, value: float, surprise: int, why: str = "") -> Iterator[Repair]:
        words = f"{names[column]} = {value:g} would fit, found {values[column]:g}{why}"
        new = list(values)
        new[column] = value
        yield from changed(words, surprise, (new[0], new[1], new[2], new[3]))

    yield from changed(f"it fits with i and j swapped, found i = {i:g}, j = {j:g}", 0, (y, z, j, i))
    yield from changed(f"it fits with y and z swapped, found {names[0]} = {y:g}, {names[1]} = {z:g}", 0, (z, y, i, j))
    for column, value in enumerate(values):
        yield from single(column, -value, 0, " (a wrong sign)")
        for factor in (10.0, 0.1):
            yield from single(column, _rounded(value * factor), 0, " (a decimal point)")
    for factor, words in ((10.0, "ten times"), (0.1, "a tenth of")):
        yield from changed(f"it fits with {words} its y and z: another unit", 0, (factor * y, factor * z, i, j))
    for column in (0, 1):
        for value in known[column]:
            yield from single(column, value, 1)
    for column, value in enumerate(values):
        for typed in _slips(value):
            yield from single(column, typed, 2)


def _slips(value: float) -> Iterator[float]:
    """Numbers of which `value` is one slip of a finger away: two digits swapped, one replaced, left out or added."""
    text = f"{abs(value):.{LARGEST_DIGITS}g}"
    if not text.replace(".", "").isdecimal():
        return
    sign = -1.0 if value < 0 else 1.0
    digits = "0123456789"
    variants = [text[:k] + text[k + 1] + text[k] + text[k + 2 :] for k in range(len(text) - 1)]
    variants += [text[:k] + text[k + 1 :] for k in range(len(text))]
    variants += [text[:k] + digit + text[k + 1 :] for k in range(len(text)) for digit in digits]
    variants += [text[:k] + digit + text[k:] for k in range(len(text) + 1) for digit in digits]
    for variant in variants:
        if variant.replace(".", "", 1).isdecimal():
            yield sign * float(variant)


def _rounded(value: float) -> float:
    return float(f"{value:.12g}")
