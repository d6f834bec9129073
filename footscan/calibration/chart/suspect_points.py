"""Control points that do not fit the others of their camera, and what may have been meant."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chart.chart import Chart
from footscan.calibration.chart.column_checks import is_below_glass, outside_image
from footscan.calibration.chart.plane_fit import PASSED, ROBUST_POINTS, agreeing, misfits, plausible_misfits
from footscan.calibration.chart.repair_proposals import FittingRepair, fitting_repairs, place_of
from schemas.base.units import MILLIMETRES

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

WRONG_AT_MOST = 1 / 3
"""Share of a camera's points that do not fit above which none is named."""
REPAIRED = 0.6
"""Misfit after a repair at most, relative to the limit. Chosen by hand."""
CONVINCING = 2.0
"""Misfit of few points, relative to the limit, from which a repair is proposed; a smaller one has many possible
repairs. Chosen by hand."""
FAR_PX = 1e4
"""Distance from which a misplaced point is reported without a number."""


@dataclass(frozen=True)
class Suspect:
    """A point that does not fit, or a misfit of all points."""

    point: int | None
    """Index of the point; None if it is unknown which one is wrong."""
    message: str


def suspects(chart: Chart, limit_px: float, chart_values: Sequence[Sequence[float]]) -> list[Suspect]:
    """Find the points of a camera that do not fit: those that add more than `limit_px` to the misfit of the others.

    `chart_values` are the values of Y and of Z that occur in the charts.
    """
    if len(chart.points) < PASSED:
        return []
    world = MILLIMETRES[chart.unit] * chart.world[:, 1:]
    if len(chart.points) < ROBUST_POINTS:
        return _of_few(chart, world, limit_px, chart_values)
    agree = agreeing(world, chart.pixels, limit_px)
    wrong = np.flatnonzero(~agree)
    if len(wrong) > WRONG_AT_MOST * len(agree):
        message = f"{len(wrong)} of {len(agree)} points do not fit with the others, expected all to lie in one plane"
        return [Suspect(None, message)]
    others = np.flatnonzero(agree)
    return [_of_many(chart, int(point), others, limit_px, chart_values) for point in wrong]


def _of_many(
    chart: Chart, point: int, others: Indices, limit_px: float, chart_values: Sequence[Sequence[float]]
) -> Suspect:
    """Describe a wrong point whose place is determined by the others."""
    repairs = fitting_repairs(chart, point, others, chart_values, REPAIRED * limit_px)
    if repairs:
        return Suspect(point, _off(chart, point, others) + "; " + repairs[0].repair.words)
    i, j = place_of(chart, point, others)
    return Suspect(
        point, f"{_off(chart, point, others)}; i = {i:.0f}, j = {j:.0f} would fit, found {_pixel(chart, point)}"
    )


def _of_few(chart: Chart, world: Floats, limit_px: float, chart_values: Sequence[Sequence[float]]) -> list[Suspect]:
    """Name the point with the least surprising repair, since any of a few points could be moved to fit."""
    distances = misfits(world[np.newaxis], chart.pixels[np.newaxis])[0]
    before = float(plausible_misfits(world[np.newaxis], chart.pixels[np.newaxis])[0])
    if before <= limit_px:
        return []
    points = np.arange(len(world))
    impossible = outside_image(chart.pixels, chart.size) | is_below_glass(chart)
    candidates = np.flatnonzero(impossible) if impossible.any() else points
    repairs = [
        repair
        for point in candidates
        for repair in fitting_repairs(chart, int(point), points[points != point], chart_values, REPAIRED * limit_px)
    ]
    if not repairs or len(world) <= PASSED or before < CONVINCING * limit_px:
        return [Suspect(None, _unexplained(chart, distances, before))]
    repairs.sort(key=lambda repair: (repair.repair.surprise, repair.misfit_px))
    best = repairs[0]
    return [Suspect(best.point, _off(chart, best.point, points[points != best.point]) + "; " + _or(chart, repairs))]


def _unexplained(chart: Chart, distances: Floats, before: float) -> str:
    """Describe a misfit `before` any repair that no repair explains, with the `distances` (N,) of the points, px."""
    unknown = f"one of them is off, and with {len(distances)} it cannot be said which"
    if not np.isfinite(before):
        return f"no camera sees points in these places so: {unknown}"
    worst = chart.points[int(distances.argmax())]
    rms, most = float(np.sqrt(np.mean(distances**2))), float(distances.max())
    return f"residual {rms:.1f} px rms against a plane seen by a camera, worst {worst} by {most:.1f} px: {unknown}"


def _or(chart: Chart, repairs: list[FittingRepair]) -> str:
    """Describe the best repair, and an equally likely one of another point."""
    best = repairs[0]
    rivals = [rival for rival in repairs if rival.point != best.point and rival.repair.surprise == best.repair.surprise]
    text = best.repair.words
    return text + (f"; or else of {chart.points[rivals[0].point]}: {rivals[0].repair.words}" if rivals else "")


def _off(chart: Chart, point: int, others: Indices) -> str:
    """Describe the distance of a point from the place that the others predict."""
    distance = float(np.hypot(*(place_of(chart, point, others) - chart.pixels[point])))
    return f"{distance:.0f} px off where the other points place it" if distance < FAR_PX else "far off the other points"


def _pixel(chart: Chart, point: int) -> str:
    return "{:g}, {:g}".format(*chart.pixels[point])
