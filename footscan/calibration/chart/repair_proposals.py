"""Proposals for mistyped control points: small changes of one point by which it fits the others."""

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
"""Digits of the longest number that is typed by hand."""
LARGEST = 1e6
"""Bound of a proposed value: no chart has larger ones."""


@dataclass(frozen=True)
class Repair:
    """A changed reading of one control point."""

    words: str
    surprise: int
    """0 for swapped values, a sign or a decimal point, 1 for a coordinate of another point, 2 for a typing error."""
    values: Values


@dataclass(frozen=True)
class FittingRepair:
    """A repair that fits the other points."""

    point: int
    """Index of the repaired point."""
    repair: Repair
    misfit_px: float


def fitting_repairs(
    chart: Chart, point: int, others: NDArray[np.intp], chart_values: Sequence[Sequence[float]], limit_px: float
) -> list[FittingRepair]:
    """Find the repairs of one point that bring its misfit to `limit_px` at most, the least surprising and best first.

    Parameters
    ----------
    point : index of the point.
    others : indices of the points that it has to fit.
    chart_values : the values of Y and of Z that occur in the charts, in the chart's own unit.
    """
    repairs = list(_repairs(_values(chart, point), chart_values, chart.unit))
    if not repairs:
        return []
    changed = np.array([repair.values for repair in repairs]).reshape(-1, 4)
    scale = MILLIMETRES[chart.unit]
    kept = np.column_stack([scale * chart.world[others, 1:], chart.pixels[others]])
    kept = np.broadcast_to(kept, (len(repairs), len(others), 4))
    own = np.concatenate([scale * changed[:, :2], changed[:, 2:]], axis=1)
    together = np.concatenate([kept, own[:, np.newaxis]], axis=1)
    without = float(np.sum(misfits(kept[:1, :, :2], kept[:1, :, 2:]) ** 2))
    misfit = plausible_misfits(together[:, :, :2], together[:, :, 2:])
    added = np.sqrt(np.clip(misfit**2 - without, 0.0, None))
    fitting = [FittingRepair(point, repairs[k], float(added[k])) for k in np.flatnonzero(added <= limit_px)]
    return sorted(fitting, key=lambda candidate: (candidate.repair.surprise, candidate.misfit_px))


def place_of(chart: Chart, point: int, others: NDArray[np.intp]) -> Floats:
    """Predict the pixel (2,) of a point, by index, from the homography of the points `others`."""
    world = MILLIMETRES[chart.unit] * chart.world[:, 1:]
    homography = fit_homographies(world[np.newaxis, others], chart.pixels[np.newaxis, others])
    return np.asarray(project(homography, world[np.newaxis, [point]])[0, 0])


def _values(chart: Chart, point: int) -> Values:
    """The values of a point, by index."""
    (_, y, z), (i, j) = chart.world[point].tolist(), chart.pixels[point].tolist()
    return y, z, i, j


def _repairs(values: Values, chart_values: Sequence[Sequence[float]], unit: str) -> Iterator[Repair]:
    """Propose changed readings of one point, each once."""
    names = (f"y_{unit}", f"z_{unit}", "i", "j")
    y, z, i, j = values
    seen = {values}

    def changed(words: str, surprise: int, new: Values) -> Iterator[Repair]:
        if new not in seen and max(map(abs, new)) < LARGEST:
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
        for value in chart_values[column]:
            yield from single(column, value, 1)
    for column, value in enumerate(values):
        for typed in _slips(value):
            yield from single(column, typed, 2)


def _slips(value: float) -> Iterator[float]:
    """Numbers that differ from `value` by one typing error: two digits swapped, one replaced, left out or added."""
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
    """The value without the rounding errors of its last digits."""
    return float(f"{value:.12g}")
