"""Control points that do not fit with the others of their camera, and what they may have been meant to be."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chart.chart import Chart
from footscan.calibration.chart.column_checks import is_below_glass, outside_image
from footscan.calibration.chart.plane_fit import PASSED, ROBUST_POINTS, agreeing, misfits, plausible_misfits
from footscan.calibration.chart.repair_proposals import Found, fitting_repairs, place_of
from schemas.base.units import MILLIMETRES

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

WRONG_AT_MOST = 1 / 3
"""Where more of a camera's points do not fit, it is not said which of them are wrong."""
REPAIRED = 0.6
"""What a repair may leave, of the misfit that is too much."""
CONVINCING = 2.0
"""With few points a repair is told for so large a misfit; a smaller one could be mended in many ways."""


@dataclass(frozen=True)
class Suspect:
    """A point that does not fit; or all of them, where it cannot be told which."""

    point: int | None
    message: str


def suspects(chart: Chart, limit_px: float, known: Sequence[Sequence[float]]) -> list[Suspect]:
    """The points of a camera that do not fit.

    A point is one where it adds more than `limit_px` to the misfit of the others. `known` holds the values of Y and of
    Z that occur in the charts.
    """
    if len(chart.points) < PASSED:
        return []
    world = MILLIMETRES[chart.unit] * chart.world[:, 1:]
    if len(chart.points) < ROBUST_POINTS:
        return _of_few(chart, world, limit_px, known)
    agree = agreeing(world, chart.pixels, limit_px)
    wrong = np.flatnonzero(~agree)
    if len(wrong) > WRONG_AT_MOST * len(agree):
        message = f"{len(wrong)} of {len(agree)} points do not fit with the others, expected all to lie in one plane"
        return [Suspect(None, message)]
    others = np.flatnonzero(agree)
    return [_of_many(chart, int(point), others, limit_px, known) for point in wrong]


def _of_many(chart: Chart, point: int, others: Indices, limit_px: float, known: Sequence[Sequence[float]]) -> Suspect:
    """The others are enough to say where the point belongs."""
    found = fitting_repairs(chart, point, others, known, REPAIRED * limit_px)
    if found:
        return Suspect(point, _off(chart, point, others) + "; " + found[0].repair.words)
    i, j = place_of(chart, point, others)
    return Suspect(
        point, f"{_off(chart, point, others)}; i = {i:.0f}, j = {j:.0f} would fit, found {_pixel(chart, point)}"
    )


def _of_few(chart: Chart, world: Floats, limit_px: float, known: Sequence[Sequence[float]]) -> list[Suspect]:
    """Any of the points could be moved to fit: the one is named whose repair is the least surprising."""
    distances = misfits(world[np.newaxis], chart.pixels[np.newaxis])[0]
    before = float(plausible_misfits(world[np.newaxis], chart.pixels[np.newaxis])[0])
    if before <= limit_px:
        return []
    every = np.arange(len(world))
    impossible = outside_image(chart.pixels) | is_below_glass(chart)
    tried = np.flatnonzero(impossible) if impossible.any() else every
    found = [
        one
        for point in tried
        for one in fitting_repairs(chart, int(point), every[every != point], known, REPAIRED * limit_px)
    ]
    if not found or len(world) <= PASSED or before < CONVINCING * limit_px:
        return [Suspect(None, _unexplained(chart, distances, before))]
    found.sort(key=lambda one: (one.repair.surprise, one.misfit_px))
    best = found[0]
    return [Suspect(best.point, _off(chart, best.point, every[every != best.point]) + "; " + _or(chart, found))]


def _unexplained(chart: Chart, distances: Floats, before: float) -> str:
    unknown = f"one of them is off, and with {len(distances)} it cannot be said which"
    if not np.isfinite(before):
        return f"no camera sees points in these places so: {unknown}"
    worst = chart.points[int(distances.argmax())]
    rms, most = float(np.sqrt(np.mean(distances**2))), float(distances.max())
    return f"residual {rms:.1f} px rms against a plane seen by a camera, worst {worst} by {most:.1f} px: {unknown}"


def _or(chart: Chart, found: list[Found]) -> str:
    """The best repair, and that of another point which is as good a guess."""
    best = found[0]
    rivals = [one for one in found if one.point != best.point and one.repair.surprise == best.repair.surprise]
    text = best.repair.words
    return text + (f"; or else of {chart.points[rivals[0].point]}: {rivals[0].repair.words}" if rivals else "")


def _off(chart: Chart, point: int, others: Indices) -> str:
    distance = float(np.hypot(*(place_of(chart, point, others) - chart.pixels[point])))
    return f"{distance:.0f} px off where the other points place it" if distance < 1e4 else "far off the other points"


def _pixel(chart: Chart, point: int) -> str:
    return "{:g}, {:g}".format(*chart.pixels[point])
