"""The surface from its six sides, over a grid in mm."""

import io
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from footscan.report.markup import data_uri, number, text
from footscan.report.render import render_mesh
from schemas.scan import Side

_PIXELS_PER_MM = 3.0
_MARGIN_MM = 8.0
_LABELS_LEFT_MM, _LABELS_BELOW_MM = 17.0, 13.0
"""Room for the figures of the grid."""
_GRID_MM = 10
_LABELLED_MM = 50


@dataclass(frozen=True)
class _View:
    """Where a picture is seen from. `right` and `up` are the axes to the right and up in it: sign, then 0 to 2."""

    title: str
    right: tuple[int, int]
    up: tuple[int, int]


def surface_views(
    vertices: NDArray[np.float64], faces: NDArray[np.integer], colours: NDArray[np.uint8], side: Side, last: str
) -> str:
    """Six pictures of a surface as SVG: from above and below, from both sides, from the toes and from the heel.

    The figure `last` follows them.

    Parameters
    ----------
    vertices : (V, 3) float64, mm, foot's frame
        X from heel to toes, Y to the foot's own left, Z up.
    faces : (F, 3) int
    colours : (V, 3) uint8, RGB
    side : tells which of its sides is the medial one
    last : markup
    """
    medial, lateral = {"right": (" (medial)", " (lateral)"), "left": (" (lateral)", " (medial)")}.get(side, ("", ""))
    x, y, z = 0, 1, 2
    views = [
        _View("From above", (1, x), (1, y)),
        _View("From below", (1, x), (-1, y)),
        _View(f"Left side{medial}", (-1, x), (1, z)),
        _View(f"Right side{lateral}", (1, x), (1, z)),
        _View("From the toes", (1, y), (1, z)),
        _View("From the heel", (-1, y), (1, z)),
    ]
    widest = max(float(np.ptp(vertices[:, view.right[1]])) for view in views) + 2 * _MARGIN_MM + _LABELS_LEFT_MM
    figures = "\n".join(_figure(view, vertices, faces, colours, widest) for view in views)
    return f'<div class="views">\n{figures}\n{last}\n</div>'


def _figure(
    view: _View, vertices: NDArray[np.float64], faces: NDArray[np.integer], colours: NDArray[np.uint8], widest: float
) -> str:
    right, up = (sign * vertices[:, axis] for sign, axis in (view.right, view.up))
    towards = np.cross(_unit(*view.right), _unit(*view.up))
    left, bottom = float(right.min()) - _MARGIN_MM, float(up.min()) - _MARGIN_MM
    rows, columns = (int(np.ceil((np.ptp(along) + 2 * _MARGIN_MM) * _PIXELS_PER_MM)) for along in (up, right))
    width, height = columns / _PIXELS_PER_MM, rows / _PIXELS_PER_MM

    seen = np.column_stack([right - left, up - bottom - height, vertices @ towards])
    picture = data_uri("image/png", _png(render_mesh(seen, faces, colours, (rows, columns), _PIXELS_PER_MM)))
    box = f"{-_LABELS_LEFT_MM:g} 0 {width + _LABELS_LEFT_MM:.2f} {height + _LABELS_BELOW_MM:.2f}"
    grid = "".join(_grid_lines(view, left, bottom, width, height))
    share = (width + _LABELS_LEFT_MM) / widest
    return (
        f'<figure class="view" style="--share:{share:.4f}"><figcaption>{text(view.title)}</figcaption>'
        f'<svg viewBox="{box}" role="img" aria-label="{text(view.title)}">{grid}'
        f'<image width="{width:.2f}" height="{height:.2f}" href="{picture}"/></svg></figure>'
    )


def _unit(sign: int, axis: int) -> NDArray[np.float64]:
    vector = np.zeros(3)
    vector[axis] = sign
    return vector


def _grid_lines(view: _View, left: float, bottom: float, width: float, height: float) -> Iterator[str]:
    """Lines every `_GRID_MM`, figures on every `_LABELLED_MM`, in the foot's own coordinates."""
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


def _png(pixels: NDArray[np.uint8]) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", compress_level=6)
    return buffer.getvalue()
