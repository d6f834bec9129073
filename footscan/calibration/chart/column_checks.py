"""Mistakes in a chart that concern a whole camera: swapped columns, or coordinates in another unit."""

from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chart.chart import Chart
from footscan.calibration.chart.plane_fit import (
    PASSED,
    ROBUST_POINTS,
    agreeing,
    fit_homographies,
    misfits,
    plausible_misfits,
    project,
    samples,
)
from schemas.base.image_size import ImageSize
from schemas.base.units import MILLIMETRES

Floats = NDArray[np.float64]

OUTSIDE_PX = 2.5
"""Distance outside the image up to which a pixel is on its border: pixels may be counted from 1, and clicks have
errors. Chosen by hand."""
BORDER_PX = 0.5
"""Distance from the outermost pixels within which a pixel is on the border."""
VIEW_MM = (30.0, 600.0)
"""Range of the width of the image in the laser plane; 107 mm in the thesis. Chosen by hand."""
GLASS_MM = 5.0
"""Depth below the glass from which no point is visible. Chosen by hand."""
OTHER_UNIT = (10.0, 0.1)
"""Factors between cm and mm."""
CLEARLY = 20.0
"""Factor by which another unit must lower the misfit of few points; chance lowers it a few times. Chosen by hand."""
MOST_AGREE, NEARLY_ALL = 0.75, 0.8
"""Least share of points that agree if rows have different units, and if columns are judged. Chosen by hand."""
MOST_NAMED = 10
"""Points that a message names at most."""


def outside_image(pixels: Floats, size: ImageSize) -> NDArray[np.bool_]:
    """Select the `pixels` (N, 2) that lie outside the image and its border; (N,)."""
    low, high = -OUTSIDE_PX, np.array(size.px) - 1.0 + OUTSIDE_PX
    return np.asarray(((pixels < low) | (pixels > high)).any(axis=1))


def is_on_border(pixels: Floats, size: ImageSize) -> NDArray[np.bool_]:
    """Select the `pixels` (N, 2) on the border of the image, whether counted from 0 or from 1; (N,)."""
    high = np.array(size.px) - 1.0 - BORDER_PX
    return np.asarray(((pixels <= BORDER_PX) | (pixels >= high)).any(axis=1) & ~outside_image(pixels, size))


def is_below_glass(chart: Chart) -> NDArray[np.bool_]:
    """Select the points of a chart that lie below the glass, where no camera sees them; (N,)."""
    return np.asarray(MILLIMETRES[chart.unit] * chart.world[:, 2] < -GLASS_MM)


def swapped_columns(chart: Chart, limit_px: float) -> str | None:
    """Describe the swapped columns of a camera; None unless they are certainly swapped."""
    x, y, z = chart.world.T
    pixels, size = chart.pixels, chart.size
    for name, column in (("y", y), ("z", z)):
        if np.ptp(column) == 0 and np.ptp(x) > 0 and len(x) > 2:
            names = f"x_{chart.unit} and {name}_{chart.unit}"
            return f"{name} is the same for all points and x is not, expected the reverse: {names} are swapped"
    if outside_image(pixels, size).any() or _view_mm(chart) > VIEW_MM[1]:
        world_as_pixels = chart.world[:, 1:]
        if not outside_image(world_as_pixels, size).any() and _view_mm(_exchanged(chart)) < VIEW_MM[1]:
            return "y and z are pixels and i and j lengths, expected the reverse: y, z and i, j are swapped"
    notes = []
    if _fits(chart, limit_px):
        outside, turned = outside_image(pixels, size), outside_image(pixels[:, ::-1], size)
        if outside.any() and (pixels[outside, 1] > size.rows).all() and not turned.any():
            most = size.rows - 1
            notes.append(f"j reaches {pixels[:, 1].max():g}, expected at most {most}: i and j are swapped")
        millimetres = MILLIMETRES[chart.unit]
        if millimetres * z.min() < -GLASS_MM and millimetres * y.min() > -GLASS_MM:
            notes.append(f"z reaches {z.min():g} {chart.unit}, below the glass at 0, y does not: y and z are swapped")
    return "; ".join(notes) or None


def other_unit(chart: Chart) -> str | None:
    """Describe a camera whose coordinates cannot be in the chart's unit; None if they can."""
    view = _view_mm(chart)
    if VIEW_MM[0] <= view <= VIEW_MM[1]:
        return None
    low, high = VIEW_MM
    expected = f"expected {low:.0f} to {high:.0f} mm: x, y and z are in another unit than {chart.unit}"
    return f"the image would be {view:.3g} mm wide at the laser, {expected}"


def rows_in_other_unit(chart: Chart, limit_px: float) -> str | None:
    """Describe the rows that fit the others if read in another unit; None if there are none."""
    world = MILLIMETRES[chart.unit] * chart.world[:, 1:]
    scales_of = _scales_of_few if len(world) < ROBUST_POINTS else _scales_of_many
    scales = scales_of(world, chart.pixels, limit_px)
    if scales is None:
        return None
    values, counts = np.unique(scales, return_counts=True)
    usual = float(values[counts.argmax()])
    rows = [int(row) for row in np.flatnonzero(scales != usual)]
    factor = float(scales[rows[0]]) / usual
    times = "ten times" if factor > 1 else "a tenth of"
    names = ", ".join(chart.points[row] for row in rows[:MOST_NAMED])
    return f"{times} their y and z would fit with the other points, expected one unit: {names}"


def _scales_of_few(world: Floats, pixels: Floats, limit_px: float) -> Floats | None:
    """The factors (N,) of the rows that bring the residual below the limit; None unless two rows or more need one."""
    count = len(world)
    if count <= PASSED:
        return None
    choices = [
        np.where(np.isin(np.arange(count), rows), factor, 1.0)
        for size in range(2, count // 2 + 1)
        for rows in combinations(range(count), size)
        for factor in OTHER_UNIT
    ]
    scales = np.array([np.ones(count), *choices])
    misfit = plausible_misfits(scales[:, :, np.newaxis] * world, pixels[np.newaxis])
    best = int(misfit.argmin())
    return scales[best] if misfit[best] <= min(limit_px, misfit[0] / CLEARLY) else None


def _scales_of_many(world: Floats, pixels: Floats, limit_px: float) -> Floats | None:
    """The factors (N,) as in `_scales_of_few`, by the method of `agreeing` with each row in its best unit."""
    options = np.array([1.0, *OTHER_UNIT])
    chosen = samples(len(world))
    homographies = fit_homographies(world[chosen], pixels[chosen])
    distances = np.stack(
        [np.linalg.norm(project(homographies, (scale * world)[np.newaxis]) - pixels, axis=2) for scale in options]
    )
    usual = np.sort(distances.min(axis=0), axis=1)[:, (3 * len(world)) // 4]
    own = distances[:, int(usual.argmin())]
    scales = np.where(own[0] <= limit_px, 1.0, options[own.argmin(axis=0)])
    agree = agreeing(scales[:, np.newaxis] * world, pixels, limit_px)
    values, counts = np.unique(scales[agree], return_counts=True)
    if agree.mean() < MOST_AGREE or len(values) < 2 or np.sort(counts)[-2] < 2:
        return None
    return np.where(agree, scales, values[counts.argmax()])


def _view_mm(chart: Chart) -> float:
    """The width of the image in the laser plane, mm, by the median ratio of distances, which ignores a few mistakes."""
    world, pixels = MILLIMETRES[chart.unit] * chart.world[:, 1:], chart.pixels
    first, second = np.triu_indices(len(world), 1)
    in_mm, in_px = (np.linalg.norm(p[first] - p[second], axis=1) for p in (world, pixels))
    apart = (in_mm > 0) & (in_px > 0)
    if not apart.any():
        return float(np.mean(VIEW_MM))
    return float(chart.size.columns * np.median(in_mm[apart] / in_px[apart]))


def _exchanged(chart: Chart) -> Chart:
    """The chart with Y, Z and i, j exchanged."""
    world = np.column_stack([chart.world[:, 0], chart.pixels])
    return replace(chart, world=world, pixels=chart.world[:, 1:])


def _fits(chart: Chart, limit_px: float) -> bool:
    """True if nearly all points agree on a homography; four points or fewer always do."""
    world = MILLIMETRES[chart.unit] * chart.world[:, 1:]
    agree = agreeing(world, chart.pixels, limit_px)
    squares = float(np.sum(misfits(world[np.newaxis, agree], chart.pixels[np.newaxis, agree]) ** 2))
    return bool(agree.mean() > NEARLY_ALL) and squares <= (2.0 * limit_px) ** 2 * max(1.0, agree.sum() - PASSED)
