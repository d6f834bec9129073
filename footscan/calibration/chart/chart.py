"""Calibration charts: control points with known world position and pixel, in one CSV file for all cameras."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schemas.base.errors import RefusedInput
from schemas.base.image_size import FRAME_SIZE, SMALLEST_FRAME, ImageSize
from schemas.base.limits import refuse_beyond
from schemas.base.units import LengthUnit
from schemas.calibration import name_of, view_number
from schemas.scan import MOST_CAMERA, MOST_LASERS
from schemas.tables import finite, read_records

LARGEST_SIDE = 16384
"""Largest width or height of an image, px: beyond any camera."""
MAX_MAGNITUDE = 1e6
"""Largest coordinate, in any unit: beyond any foot scanner, and its powers stay finite."""

_WORLD: dict[LengthUnit, tuple[str, str, str]] = {
    "cm": ("x_cm", "y_cm", "z_cm"),
    "mm": ("x_mm", "y_mm", "z_mm"),
}
_SIZE = ("width_px", "height_px")
"""Optional columns: the size of the camera's images."""
_LASER = "laser"
"""Optional column: the number of the laser that the point lies in, among those of the camera's head."""
_CAMERA = re.compile(r"[1-9][0-9]{0,8}")


@dataclass(frozen=True)
class Chart:
    """The control points of one camera."""

    camera: int
    points: tuple[str, ...]
    """Names of the points, all different."""
    world: NDArray[np.float64]
    """(N, 3): X, Y, Z in the chart's own `unit`, scanner frame."""
    unit: LengthUnit
    pixels: NDArray[np.float64]
    """(N, 2): column i and row j, px, the centre of the top-left pixel at (0, 0)."""
    size: ImageSize = FRAME_SIZE
    """Of the camera's images."""
    laser: int = 1
    """Number of the laser in whose plane the points lie."""

    @property
    def view(self) -> int:
        """Number of the view, as in `schemas.calibration.view_number`."""
        return view_number(self.camera, self.laser)

    @property
    def name(self) -> str:
        """The camera and, if it is not the first one, the laser."""
        return name_of(self.camera, self.laser)


def most_spread(chart: Chart, count: int) -> Chart:
    """The `count` control points that a person would click who clicks few: corners that are far from each other.

    The first one is the farthest from the middle of the picture's points, each further one the farthest from those
    before it. The points keep their order.

    >>> grid = np.array([[i, j] for i in range(5) for j in range(5)], np.float64)
    >>> chart = Chart(1, tuple(map(str, range(25))), np.column_stack([0 * grid[:, 0], grid]), "mm", grid)
    >>> most_spread(chart, 5).pixels.tolist()
    [[0.0, 0.0], [0.0, 4.0], [2.0, 2.0], [4.0, 0.0], [4.0, 4.0]]
    """
    pixels = chart.pixels
    chosen = [int(np.argmax(np.linalg.norm(pixels - pixels.mean(axis=0), axis=1)))]
    while len(chosen) < min(count, len(pixels)):
        away = np.linalg.norm(pixels[:, None] - pixels[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(away)))
    kept = np.sort(chosen)
    points = tuple(chart.points[k] for k in kept)
    return replace(chart, points=points, world=chart.world[kept], pixels=pixels[kept])


@dataclass(frozen=True)
class _Row:
    line: int
    camera: int
    laser: int
    point: str
    world: tuple[float, float, float]
    pixel: tuple[float, float]
    size: ImageSize


def read_chart(path: Path) -> dict[int, Chart]:
    """Read the charts of all cameras from the CSV file `path`.

    Columns are `camera,point,x_cm,y_cm,z_cm,i,j`, or `_mm` instead of `_cm`, in any order, one control point a
    row. The optional columns `width_px,height_px` have the size of the camera's images; without them it is that of the
    scanner's own cameras. The optional column `laser` has the number of the laser, of cameras that see two.

    Returns
    -------
    View, as numbered by `schemas.calibration.view_number`, -> chart, by ascending number.

    Raises
    ------
    RefusedInput
        The file does not follow the format; the message names file, line, column and what was expected.
    """
    records = read_records(path)
    try:
        line, header = next(records)
    except StopIteration:
        raise RefusedInput(path, f"is empty, expected a header {_header('mm')} and control points") from None
    unit, columns = _columns(path, line, header)
    rows: list[_Row] = []
    seen: dict[tuple[int, str], int] = {}
    sizes: dict[int, ImageSize] = {}
    for line, cells in records:
        row = _row(path, line, cells, unit, columns)
        view = view_number(row.camera, row.laser)
        first = seen.setdefault((view, row.point), line)
        if first != line:
            problem = f"camera {row.camera} has {row.point!r} in line {first} already, expected each point once"
            raise RefusedInput(path, problem, field=f"line {line}, column point")
        rows.append(row)
        if row.size != (of_first := sizes.setdefault(row.camera, row.size)):
            problem = f"camera {row.camera} has images of {of_first} before, expected one size, found {row.size}"
            raise RefusedInput(path, problem, field=f"line {line}, column {_SIZE[0]}")
        refuse_beyond("chart_points", len(rows), path)
    if not rows:
        raise RefusedInput(path, "has a header but no control point, expected at least one row")
    by_view: dict[int, list[_Row]] = {}
    for row in rows:
        by_view.setdefault(view_number(row.camera, row.laser), []).append(row)
    return {view: _chart(unit, by_view[view]) for view in sorted(by_view)}


def _columns(path: Path, line: int, header: list[str]) -> tuple[LengthUnit, dict[str, int]]:
    """The unit of the chart, and the index of each column."""
    where = f"line {line}"
    names = [name.lower() for name in header]
    units: list[LengthUnit] = [unit for unit, world in _WORLD.items() if set(world) & set(names)]
    if len(units) > 1:
        raise RefusedInput(path, "mixes cm and mm, expected one unit for x, y and z", field=where)
    unit = units[0] if units else "mm"
    expected = _header(unit) if units else f"{_header('cm')} or {_header('mm')}"
    valid_names = {"camera", "point", "i", "j", *_WORLD[unit], *_SIZE, _LASER}
    if len(header) == 1:
        raise RefusedInput(path, f"one column, expected {expected}, with commas between them", field=where)
    for name in header:
        if name.lower() not in valid_names:
            raise RefusedInput(
                path, f"unknown column, expected {expected}", field=f"{where}, column {name or '(empty)'}"
            )
        if names.count(name.lower()) > 1:
            raise RefusedInput(path, "is listed twice, expected each column once", field=f"{where}, column {name}")
    for name in (*_header(unit).split(","), *(_SIZE if set(_SIZE) & set(names) else ())):
        if name not in names:
            raise RefusedInput(path, f"is missing, expected {expected}", field=f"{where}, column {name}")
    return unit, {name: index for index, name in enumerate(names)}


def _header(unit: LengthUnit) -> str:
    return ",".join(("camera", "point", *_WORLD[unit], "i", "j"))


def _row(path: Path, line: int, cells: list[str], unit: LengthUnit, columns: dict[str, int]) -> _Row:
    if len(cells) != len(columns):
        problem = f"expected {len(columns)} values, one for each column of the header, found {len(cells)}"
        raise RefusedInput(path, problem, field=f"line {line}")

    def refuse(column: str, expected: str) -> RefusedInput:
        text = cells[columns[column]][:80]
        return RefusedInput(path, f"expected {expected}, found {text!r}", field=f"line {line}, column {column}")

    def number(column: str) -> float:
        text = cells[columns[column]]
        value = finite(text)
        if not abs(value) <= MAX_MAGNITUDE:
            raise refuse(column, f"a number between -{MAX_MAGNITUDE:.0f} and {MAX_MAGNITUDE:.0f}")
        return value

    camera = cells[columns["camera"]]
    if not _CAMERA.fullmatch(camera):
        raise refuse("camera", "a whole number from 1")
    point = cells[columns["point"]]
    if not point:
        raise refuse("point", "a name")
    x, y, z = (number(column) for column in _WORLD[unit])
    size = FRAME_SIZE
    if _SIZE[0] in columns:
        for column, least in zip(_SIZE, SMALLEST_FRAME.px, strict=True):
            if not number(column).is_integer() or not least <= number(column) <= LARGEST_SIDE:
                raise refuse(column, f"a whole number from {least} to {LARGEST_SIDE}")
        size = ImageSize(rows=int(number(_SIZE[1])), columns=int(number(_SIZE[0])))
    laser = 1
    if _LASER in columns:
        if int(camera) > MOST_CAMERA:
            raise refuse("camera", f"a whole number from 1 to {MOST_CAMERA} in a chart with lasers")
        if not 1 <= number(_LASER) <= MOST_LASERS or not number(_LASER).is_integer():
            raise refuse(_LASER, f"a whole number from 1 to {MOST_LASERS}")
        laser = int(number(_LASER))
    return _Row(line, int(camera), laser, point, (x, y, z), (number("i"), number("j")), size)


def _chart(unit: LengthUnit, own: list[_Row]) -> Chart:
    return Chart(
        camera=own[0].camera,
        points=tuple(row.point for row in own),
        world=np.array([row.world for row in own]),
        unit=unit,
        pixels=np.array([row.pixel for row in own]),
        size=own[0].size,
        laser=own[0].laser,
    )
