"""Pictures of a surface from six sides, over a grid in mm."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.topology import vertex_normals
from footscan.report.markup import data_uri, number, text
from footscan.report.render import png_bytes, render_mesh
from schemas.base.model import Side

PIXELS_PER_MM = 3.0
_MARGIN_MM = 8.0
"""Resolution and margin of the pictures; chosen by hand."""
_LABELS_LEFT_MM, _LABELS_BELOW_MM = 17.0, 13.0
"""Room for the figures of the grid."""
_GRID_MM = 10
_LABELLED_MM = 50
"""Spacing of the lines of the grid, and of the labelled lines."""


@dataclass(frozen=True)
class View:
    """The direction of a picture. `right` and `up` are the axes that point right and up: sign, then axis 0 to 2."""

    title: str
    right: tuple[int, int]
    up: tuple[int, int]


X, Y, Z = range(3)
"""Axes of the foot's frame."""


def views_of(side: Side | None) -> list[View]:
    """The six views of a foot in its own frame, named for its side; without a side they are named for the axes.

    A foot has X from heel to toes, Y to its own left, Z up.
    """
    medial, lateral = {"right": (" (medial)", " (lateral)"), "left": (" (lateral)", " (medial)")}.get(
        side or "", ("", "")
    )
    left, right = f"Left side{medial}", f"Right side{lateral}"
    front, back = "From the toes", "From the heel"
    if side is None:
        left, right, front, back = (f"From {axis}" for axis in ("+Y", "−Y", "+X", "−X"))
    return [
        View("From above", (1, X), (1, Y)),
        View("From below", (1, X), (-1, Y)),
        View(left, (-1, X), (1, Z)),
        View(right, (1, X), (1, Z)),
        View(front, (1, Y), (1, Z)),
        View(back, (-1, Y), (1, Z)),
    ]


def upright(
    vertices: NDArray[np.float64], transform: Sequence[Sequence[float]] | NDArray[np.float64]
) -> NDArray[np.float64]:
    """Move (V, 3) vertices, mm, from the scanner's frame to the foot's by the 4 x 4 `transform` of its measures.

    X runs from heel to toes, Y to the foot's own left, Z up. The transform mirrors left feet into right feet; this
    mirror is undone here, so that pictures show the foot as it is.
    """
    matrix = np.array(transform, np.float64)
    if np.linalg.det(matrix[:3, :3]) < 0:
        matrix[1] *= -1
    moved: NDArray[np.float64] = vertices @ matrix[:3, :3].T + matrix[:3, 3]
    return moved


def surface_views(
    vertices: NDArray[np.float64],
    faces: NDArray[np.integer],
    colours: NDArray[np.uint8],
    side: Side | None,
    last: str = "",
) -> str:
    """Draw the six views of `views_of` as SVG, followed by the figure `last`.

    Parameters
    ----------
    vertices : (V, 3) float64, mm, foot's frame
    faces : (F, 3) int
    colours : (V, 3) uint8, RGB
    side : which foot it is; None if the surface is not a foot
    last : markup; default: none
    """
    views = views_of(side)
    widest = max(float(np.ptp(vertices[:, view.right[1]])) for view in views) + 2 * _MARGIN_MM + _LABELS_LEFT_MM
    normals = vertex_normals(vertices, faces)
    figures = "\n".join(_figure(view, vertices, faces, colours, normals, widest) for view in views)
    return f'<div class="views">\n{figures}\n{last}\n</div>'


def render_view(
    view: View,
    vertices: NDArray[np.float64],
    faces: NDArray[np.integer],
    colours: NDArray[np.uint8],
    normals: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.uint8], float, float]:
    """Render a view as (rows, columns, 4) uint8, RGBA, at `PIXELS_PER_MM`; also return its left and lower edge in mm.

    Parameters as in `surface_views`; `normals` : (V, 3) outward unit vectors, computed by default
    """
    right, up = (sign * vertices[:, axis] for sign, axis in (view.right, view.up))
    towards = np.cross(_unit(*view.right), _unit(*view.up))
    left, bottom = float(right.min()) - _MARGIN_MM, float(up.min()) - _MARGIN_MM
    rows, columns = (int(np.ceil((np.ptp(along) + 2 * _MARGIN_MM) * PIXELS_PER_MM)) for along in (up, right))
    seen = np.column_stack([right - left, up - bottom - rows / PIXELS_PER_MM, vertices @ towards])
    turned = None if normals is None else normals @ np.column_stack([_unit(*view.right), _unit(*view.up), towards])
    return render_mesh(seen, faces, colours, (rows, columns), PIXELS_PER_MM, turned), left, bottom


def _figure(
    view: View,
    vertices: NDArray[np.float64],
    faces: NDArray[np.integer],
    colours: NDArray[np.uint8],
    normals: NDArray[np.float64],
    widest: float,
) -> str:
    pixels, left, bottom = render_view(view, vertices, faces, colours, normals)
    width, height = pixels.shape[1] / PIXELS_PER_MM, pixels.shape[0] / PIXELS_PER_MM
    picture = data_uri("image/png", png_bytes(pixels))
    box = f"{-_LABELS_LEFT_MM:g} 0 {width + _LABELS_LEFT_MM:.2f} {height + _LABELS_BELOW_MM:.2f}"
    grid = "".join(_grid_lines(view, left, bottom, width, height))
    share = min(1.0, (width + _LABELS_LEFT_MM) / widest)  # two must fit side by side, rounded to pixels
    return (
        f'<figure class="view" style="--share:{share:.4f}"><figcaption>{text(view.title)}</figcaption>'
        f'<svg viewBox="{box}" role="img" aria-label="{text(view.title)}">{grid}'
        f'<image width="{width:.2f}" height="{height:.2f}" href="{picture}"/></svg></figure>'
    )


def _unit(sign: int, axis: int) -> NDArray[np.float64]:
    vector = np.zeros(3)
    vector[axis] = sign
    return vector


def _grid_lines(view: View, left: float, bottom: float, width: float, height: float) -> Iterator[str]:
    """Grid lines every `_GRID_MM`, with figures every `_LABELLED_MM`, in the foot's own coordinates."""
    for at in range(_multiple_above(left), int(np.floor(left + width)) + 1, _GRID_MM):
        place = f"{at - left:.2f}"
        labelled = at % _LABELLED_MM == 0
        yield f'<path class="{"g5" if labelled else "g1"}" d="M{place} 0V{height:.2f}"/>'
        if labelled:
            yield f'<text x="{place}" y="{height + 10:.2f}" text-anchor="middle">{number(view.right[0] * at)}</text>'
    for at in range(_multiple_above(bottom), int(np.floor(bottom + height)) + 1, _GRID_MM):
        place = f"{height - (at - bottom):.2f}"
        labelled = at % _LABELLED_MM == 0
        yield f'<path class="{"g5" if labelled else "g1"}" d="M0 {place}H{width:.2f}"/>'
        if labelled:
            yield f'<text x="-2" y="{place}" dy=".35em" text-anchor="end">{number(view.up[0] * at)}</text>'


def _multiple_above(least: float) -> int:
    return int(np.ceil(least / _GRID_MM)) * _GRID_MM
