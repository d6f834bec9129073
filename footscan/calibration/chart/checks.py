"""Detection of mistakes in a chart: its points must lie in a plane and be seen by a camera with a known image size.

Residuals are judged in px, against the homography of the camera's other points and against other cameras.

Certain mistakes are refused: a point outside the image; columns swapped for a whole camera; another unit than in the
header, for a camera or for several of its rows. A calibration of such a chart is of no use, and the remedy is obvious.

Other findings are warnings: a coordinate or pixel that does not fit the others, with the value that would; a residual
that no single change explains; a point on the border of the image, whose true place may lie outside; one corner at two
pixels; points nearly on a line; a camera that sees the plane mirrored; points below the glass. With five points a
camera, each of them could be moved to fit, so that the warning is a guess, and the user decides.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chart.chart import Chart
from footscan.calibration.chart.column_checks import (
    is_below_glass,
    is_on_border,
    other_unit,
    outside_image,
    rows_in_other_unit,
    swapped_columns,
)
from footscan.calibration.chart.plane_fit import PASSED, agreeing, fit_homographies, misfits, sees_mirrored
from footscan.calibration.chart.repair_proposals import place_of
from footscan.calibration.chart.suspect_points import suspects
from schemas.base.errors import RefusedInput
from schemas.base.units import MILLIMETRES

Floats = NDArray[np.float64]
Kind = Literal[
    "outside", "swapped", "unit", "mistyped", "residual", "border", "twice", "line", "mirrored", "below", "plane"
]

CERTAIN: frozenset[Kind] = frozenset({"outside", "swapped", "unit"})
"""Kinds of mistakes that are refused."""
USUAL = 3.0
"""Ratio of a camera's residual to that of the others from which it is too large. Chosen by hand."""
LEVEL_PX = (1.5, 4.0)
"""Residual below which it is never too large, and above which it always is. Chosen by hand."""
MANY_POINTS = 12
"""Number of points from which a camera's own residual shows how well they were clicked. Chosen by hand."""
ONE_OF_FEW = np.sqrt(5.0)
"""Misfit that one point adds, relative to the level: it brings the root mean square of five points to the level."""
ON_A_LINE = 0.03
"""Ratio of width to length up to which points lie on a line. Chosen by hand."""
SAME_PLACE_MM = 3.0
"""Distance up to which two corners may have one pixel. Chosen by hand."""


@dataclass(frozen=True)
class ChartWarning:
    """A mistake, certain or possible."""

    camera: int
    point: str | None
    """Name of the point; None for a mistake of all points of the camera."""
    kind: Kind
    message: str

    @property
    def place(self) -> str:
        """The camera and the point, as text."""
        return f"camera {self.camera}" + ("" if self.point is None else f", point {self.point}")

    def __str__(self) -> str:
        return f"{self.place}: {self.message}"


def check_charts(charts: Mapping[int, Chart]) -> list[ChartWarning]:
    """Find possible mistakes in the charts of all cameras, ordered by camera."""
    usual = {camera: rms for camera, chart in charts.items() if (rms := _usual_rms(chart)) is not None}
    values = [sorted({value for chart in charts.values() for value in chart.world[:, k].tolist()}) for k in (1, 2)]
    warnings: list[ChartWarning] = []
    for camera in sorted(charts):
        others = [rms for other, rms in usual.items() if other != camera]
        warnings += _check_camera(charts[camera], usual.get(camera), others, values)
    misled = {warning.camera for warning in warnings if warning.kind not in ("border", "twice", "plane", "below")}
    warnings += _mirrored([chart for camera, chart in charts.items() if camera not in misled])
    return sorted(warnings, key=lambda warning: warning.camera)


def refuse_mistakes(warnings: Iterable[ChartWarning], source: Path | str) -> None:
    """Refuse a chart for its first certain mistake.

    Raises
    ------
    RefusedInput
        The message names file, camera, point and what was expected.
    """
    certain = [warning for warning in warnings if warning.kind in CERTAIN]
    if certain:
        more = f" (and {len(certain) - 1} more mistakes)" if len(certain) > 1 else ""
        raise RefusedInput(source, certain[0].message + more, field=certain[0].place)


def _usual_rms(chart: Chart) -> float | None:
    """Residual of the points that agree on a homography, px rms; None if the points are too few or on a line."""
    if len(chart.points) <= PASSED or _line(chart) is not None:
        return None
    world = _millimetres(chart)
    agree = agreeing(world, chart.pixels, LEVEL_PX[1])
    distances = misfits(world[np.newaxis, agree], chart.pixels[np.newaxis, agree])[0]
    return float(np.sqrt(np.mean(distances**2)))


def _check_camera(
    chart: Chart, own_rms: float | None, others_rms: list[float], chart_values: Sequence[Sequence[float]]
) -> Iterator[ChartWarning]:
    """Find the mistakes of one camera; a mistake of all its points hides the others."""
    level = _level(chart, own_rms, others_rms)
    limit = ONE_OF_FEW * level
    for message, kind in _of_all_points(chart, limit):
        if message is not None:
            yield ChartWarning(chart.camera, None, kind, message)
            return
    yield from _off_plane(chart)
    suspected = suspects(chart, limit, chart_values)
    if suspected and (rows := rows_in_other_unit(chart, limit)) is not None:
        yield ChartWarning(chart.camera, None, "unit", rows)
        return
    named = {suspect.point for suspect in suspected}
    for suspect in suspected:
        if suspect.point is None:
            message = suspect.message + _beside_others(others_rms)
            yield ChartWarning(chart.camera, None, "residual", message)
        elif not outside_image(chart.pixels, chart.size)[suspect.point]:
            yield ChartWarning(chart.camera, chart.points[suspect.point], "mistyped", suspect.message)
    if not suspected and own_rms is not None and own_rms > level:
        message = f"residual {own_rms:.1f} px rms against a plane seen by a camera" + _beside_others(others_rms)
        yield ChartWarning(chart.camera, None, "residual", message)
    reasons = {suspect.point: f"; {suspect.message}" for suspect in suspected}
    for point in np.flatnonzero(outside_image(chart.pixels, chart.size)).tolist():
        i, j = chart.pixels[point]
        expected = f"expected 0 to {chart.size.columns - 1} and 0 to {chart.size.rows - 1}"
        message = f"i = {i:g}, j = {j:g} lies outside of the image, {expected}"
        yield ChartWarning(chart.camera, chart.points[point], "outside", message + reasons.get(point, ""))
    yield from _below(chart, named)
    yield from _border(chart, named, limit)
    yield from _twice(chart, named, limit)


def _level(chart: Chart, own_rms: float | None, others_rms: list[float]) -> float:
    """The residual, px rms, above which that of this camera is too large."""
    if own_rms is not None and len(chart.points) >= MANY_POINTS:
        others_rms = [own_rms]
    elif len(others_rms) < 2:
        return LEVEL_PX[1]
    return float(np.clip(USUAL * np.median(others_rms), *LEVEL_PX))


def _of_all_points(chart: Chart, limit: float) -> Iterator[tuple[str | None, Kind]]:
    """Check for mistakes of all points, one after the other; None for each that is absent."""
    yield swapped_columns(chart, limit), "swapped"
    unit = other_unit(chart)
    yield unit and (rows_in_other_unit(chart, limit) or unit), "unit"
    yield _line(chart), "line"


def _line(chart: Chart) -> str | None:
    """Describe points that lie nearly on a line; None if they cover an area."""
    for name, points in (("pixels", chart.pixels), ("world positions", chart.world[:, 1:])):
        length, width = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[[0, -1]]
        if len(points) > 2 and width <= ON_A_LINE * length:
            return f"the {name} of all points lie nearly on one line, expected them to cover an area"
    return None


def _off_plane(chart: Chart) -> Iterator[ChartWarning]:
    """Find a single point at another X; several may have been clicked in frames at another position of the head."""
    values, counts = np.unique(chart.world[:, 0], return_counts=True)
    if len(values) == 2 and counts.min() == 1 and len(chart.points) > PASSED:
        usual, odd = values[counts.argmax()], values[counts.argmin()]
        point = chart.points[int(np.flatnonzero(chart.world[:, 0] == odd)[0])]
        message = f"x_{chart.unit} = {odd:g}, expected {usual:g}, which all other points have"
        yield ChartWarning(chart.camera, point, "plane", message)


def _below(chart: Chart, named: set[int | None]) -> Iterator[ChartWarning]:
    """Find points below the glass, without those already `named`."""
    below = [point for point in np.flatnonzero(is_below_glass(chart)).tolist() if point not in named]
    if below:
        lowest = chart.world[:, 2].min()
        message = f"z reaches {lowest:g} {chart.unit}, expected nothing below the glass at 0: a wrong sign of z?"
        yield ChartWarning(chart.camera, chart.points[below[0]] if len(below) == 1 else None, "below", message)


def _border(chart: Chart, named: set[int | None], limit: float) -> Iterator[ChartWarning]:
    """Find points on the border of the image, unless many other points confirm their place."""
    count = len(chart.points)
    for point in np.flatnonzero(is_on_border(chart.pixels, chart.size)).tolist():
        others = np.delete(np.arange(count), point)
        placed = count >= MANY_POINTS and np.hypot(*(place_of(chart, point, others) - chart.pixels[point])) <= limit
        if point not in named and not placed:
            i, j = chart.pixels[point]
            message = f"i = {i:g}, j = {j:g} lies on the border of the image: the corner itself may lie beyond it"
            yield ChartWarning(chart.camera, chart.points[point], "border", message)


def _twice(chart: Chart, named: set[int | None], limit: float) -> Iterator[ChartWarning]:
    """Find one corner at two pixels, and two corners at one pixel."""
    world = _millimetres(chart)
    for first, name in enumerate(chart.points):
        in_mm, in_px = (np.hypot(*(places[first] - places[first + 1 :]).T) for places in (world, chart.pixels))
        is_twin = ((in_mm == 0.0) & (in_px > limit)) | ((in_px == 0.0) & (in_mm > SAME_PLACE_MM))
        for k in np.flatnonzero(is_twin).tolist():
            if first in named or first + 1 + k in named:
                continue
            twin = chart.points[first + 1 + k]
            if in_mm[k] == 0.0:
                message = f"is where {name} is, but seen {in_px[k]:.1f} px away, expected one pixel for one corner"
            else:
                message = f"has the pixel of {name}, {in_mm[k]:.0f} mm away, expected another"
            yield ChartWarning(chart.camera, twin, "twice", message)


def _mirrored(charts: list[Chart]) -> Iterator[ChartWarning]:
    """Find cameras that see the plane mirrored; those of odd and of even number look at it from opposite sides."""
    mirrored: dict[int, bool] = {}
    for chart in charts:
        if len(chart.points) >= PASSED:
            world = _millimetres(chart)
            agree = agreeing(world, chart.pixels, LEVEL_PX[1])
            homography = fit_homographies(world[np.newaxis, agree], chart.pixels[np.newaxis, agree])[0]
            mirrored[chart.camera] = sees_mirrored(homography, world[agree]) ^ (chart.camera % 2 == 0)
    wrong = [camera for camera, is_mirrored in mirrored.items() if is_mirrored]
    if 2 * len(wrong) > len(mirrored):
        wrong = [camera for camera, is_mirrored in mirrored.items() if not is_mirrored]
    if len(mirrored) < 3 or len(wrong) > len(mirrored) / 3:
        return
    for camera in wrong:
        message = (
            "sees the plane the other way round than the other cameras of odd or even number: "
            "i and j, or y and z, are swapped, or one of them has the wrong sign"
        )
        yield ChartWarning(camera, None, "mirrored", message)


def _beside_others(others_rms: list[float]) -> str:
    """The usual residual of the other cameras, as the end of a message."""
    return f"; {np.median(others_rms):.1f} px is usual for the other cameras" if others_rms else ""


def _millimetres(chart: Chart) -> Floats:
    """Y and Z (N, 2) of the points, mm."""
    return np.asarray(MILLIMETRES[chart.unit] * chart.world[:, 1:])
