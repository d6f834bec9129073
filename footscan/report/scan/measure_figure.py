"""A figure of a foot with its landmarks, axis and girths, in which a wrong landmark is seen at a glance."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from footscan.mesh.sampling import sample_surface
from footscan.report.panels import INK, png_of
from footscan.report.scan.measure_drawings import girth_loops, landmark_place
from footscan.report.surface_views import PIXELS_PER_MM, View, render_view, upright, views_of
from schemas.measures import Measure, Measures

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

VIEWS = 4
"""The first four of `views_of`: above, below, both sides."""
SKIN = (225, 221, 214)
HIDDEN_MM = 4.0
"""A point that lies deeper behind the visible surface is on the far side of the foot; chosen by hand."""
CELL_MM, SAMPLES = 3.0, 60_000
"""Grid of the depth map, and points sampled on the surface for it: several in a cell."""
LABEL_STEP_MM, LABEL_ROWS = 7.0, 4
"""Spacing of the rows of labels above and below the foot, and their number; chosen by hand."""
METHODS = {"geometric": "o", "fallback": "s", "manual": "D"}
"""Marker of a landmark by the method that located it."""


class _Foot(NamedTuple):
    """A foot in the frame of the pictures, which is that of `upright`."""

    vertices: Floats
    faces: NDArray[np.integer]
    landmarks: Mapping[str, tuple[Floats, str]]
    """Position, (3,) mm, and method of each landmark."""
    girths: dict[str, list[Floats]]
    """Closed curves of each girth, (N, 3) mm; the last point is the first."""


def measure_figure(vertices: NDArray[np.floating], faces: NDArray[np.integer], measures: Measures) -> bytes:
    """Draw a foot from above, below and both sides, as PNG; landmarks and curves on the far side are pale.

    Parameters
    ----------
    vertices : (V, 3) mm, the frame of the mesh that was measured
    faces : (F, 3)
    """
    from matplotlib.figure import Figure

    foot = _in_view(np.asarray(vertices, np.float64), faces, measures)
    colours = dict(zip(foot.girths, _colours(len(foot.girths)), strict=True))
    figure = Figure(figsize=(16.0, 10.0), layout="constrained")
    for place, view in zip(figure.subplots(2, 2).ravel(), views_of(measures.side)[:VIEWS], strict=True):
        _draw_view(place, view, foot, colours)
    for name, colour in colours.items():
        figure.axes[0].plot([], [], color=colour, label=_girth_label(name, measures.measures[name]))
    figure.axes[0].plot([], [], color=INK, linestyle="--", linewidth=1, label=f"axis ({measures.axis})")
    for method, marker in METHODS.items():
        if any(used == method for _, used in foot.landmarks.values()):
            figure.axes[0].plot([], [], marker, color=INK, markerfacecolor="white", label=f"landmark, {method}")
    figure.legend(loc="outside lower center", ncols=5, frameon=False, fontsize=10)
    return png_of(figure)


def _in_view(vertices: Floats, faces: NDArray[np.integer], measures: Measures) -> _Foot:
    landmarks = {
        name: (landmark_place(measures, name), landmark.method) for name, landmark in measures.landmarks.items()
    }
    seen = upright(vertices, measures.transform)
    return _Foot(seen, faces, landmarks, girth_loops(vertices, faces, measures))


def _draw_view(place: "Axes", view: View, foot: _Foot, colours: Mapping[str, str]) -> None:
    skin = np.tile(np.array(SKIN, np.uint8), (len(foot.vertices), 1))
    picture, left, bottom = render_view(view, foot.vertices, foot.faces, skin)
    rows, columns = picture.shape[:2]
    place.imshow(picture, extent=(left, left + columns / PIXELS_PER_MM, bottom, bottom + rows / PIXELS_PER_MM))
    flat = _Flat(view, sample_surface(foot.vertices, foot.faces, SAMPLES))
    for name, loops in foot.girths.items():
        for loop in loops:
            near = flat.is_near(loop)
            right, up, _ = flat.of(loop)
            place.plot(right, up, color=colours[name], linewidth=1, alpha=0.25)
            place.plot(np.where(near, right, np.nan), up, color=colours[name], linewidth=1.8)
    longest = float(foot.vertices[:, 0].max())
    axis = np.array([[0.0, 0.0, 0.0], [longest, 0.0, 0.0]])
    right, up, _ = flat.of(axis)
    place.plot(right, up, color=INK, linestyle="--", linewidth=1)
    _draw_landmarks(place, foot, flat)
    place.set_title(view.title, fontsize=11, color=INK)
    place.set_aspect("equal")
    right, up, _ = flat.of(foot.vertices)
    room = LABEL_STEP_MM * (LABEL_ROWS + 1)
    place.set_xlim(right.min() - room, right.max() + room)
    place.set_ylim(up.min() - room, up.max() + room)
    place.set_axis_off()


class _Flat:
    """Coordinates of a view, mm: right, up, and towards the viewer; and the depth map of the foot in it."""

    def __init__(self, view: View, surface: Floats) -> None:
        axes = np.zeros((2, 3))
        for row, (sign, axis) in zip(axes, (view.right, view.up), strict=True):
            row[axis] = sign
        self._axes = np.vstack([axes, np.cross(*axes)])
        right, up, depth = self.of(surface)
        self._corner = np.array([right.min(), up.min()])
        cells = self._cells(right, up)
        front = np.full(cells.max(axis=0) + 1, -np.inf)
        np.maximum.at(front, (cells[:, 0], cells[:, 1]), depth)
        self._front = minimum_filter(front, size=3, mode="constant", cval=-np.inf)  # the outline belongs to both sides

    def of(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Right, up and towards the viewer of (N, 3) points: (N,) each, mm."""
        right, up, depth = (points @ self._axes.T).T
        return right, up, depth

    def is_near(self, points: Floats) -> NDArray[np.bool_]:
        """True for each of (N, 3) points on the visible side of the foot, (N,)."""
        right, up, depth = self.of(points)
        cells = np.clip(self._cells(right, up), 0, np.array(self._front.shape) - 1)
        return depth >= self._front[cells[:, 0], cells[:, 1]] - HIDDEN_MM

    def _cells(self, right: Floats, up: Floats) -> NDArray[np.int64]:
        cells: NDArray[np.int64] = np.floor((np.column_stack([right, up]) - self._corner) / CELL_MM).astype(np.int64)
        return cells


def _draw_landmarks(place: "Axes", foot: _Foot, flat: _Flat) -> None:
    """Draw all landmarks, with names for those on the near side; the names stand above and below the foot."""
    named = []
    for name, (point, method) in foot.landmarks.items():
        right, up, _ = flat.of(point[None])
        near = bool(flat.is_near(point[None])[0])
        place.plot(
            right, up, METHODS[method], color=INK, markersize=5, markerfacecolor="#d62728" if near else "none",
            alpha=1.0 if near else 0.3,
        )  # fmt: skip
        if near:
            named.append((float(right[0]), float(up[0]), name.replace("_", " ")))
    _, ups, _ = flat.of(foot.vertices)
    middle = (ups.min() + ups.max()) / 2
    for above, level in ((True, float(ups.max())), (False, float(ups.min()))):
        side = sorted(entry for entry in named if bool(entry[1] >= middle) == above)
        for number, (at, height, name) in enumerate(side):
            offset = LABEL_STEP_MM * (1 + number % LABEL_ROWS)
            place.annotate(
                name, (at, height), (at, level + offset if above else level - offset), fontsize=8, color=INK,
                ha="center", va="center", arrowprops={"arrowstyle": "-", "color": INK, "linewidth": 0.5, "alpha": 0.5},
            )  # fmt: skip


def _girth_label(name: str, measure: Measure) -> str:
    return f"{name.replace('_', ' ')}: {measure.value:.1f} mm" if measure.value is not None else name


def _colours(count: int) -> list[str]:
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [to_hex(colormaps["tab10"](number % 10)) for number in range(count)]
