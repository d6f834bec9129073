"""Points of each camera that were removed, and why: counts, and pictures coloured by reason."""

import io
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from footscan.cloud.outliers.remove import KEPT, REASONS
from footscan.cloud.points import coordinates
from footscan.report.markup import data_uri, key, number, table, text, words
from schemas.quality import CameraQuality

_COLOURS = {
    "volume": (20, 20, 20),
    "extrapolated": (230, 159, 0),
    "end": (86, 180, 233),
    "isolated": (213, 94, 0),
    "unconfirmed": (204, 121, 167),
    "glass": (0, 90, 170),
    "clutter": (0, 158, 115),
    "median": (240, 228, 66),
    "laser": (136, 34, 85),
}
"""All but the first are distinct for colour-blind readers (Okabe and Ito, "Color universal design", 2008)."""
_KEPT_COLOUR, _GROUND, _GLASS = (190, 197, 204), (255, 255, 255), (221, 226, 231)
_PALETTE = [_KEPT_COLOUR, *(_COLOURS[reason] for reason in REASONS), _GROUND, _GLASS]
"""Colours of the pixels by code: kept, then the reasons in their order, then ground and glass."""
_PIXELS_PER_MM = 1.5
"""Resolution of the pictures; chosen by hand."""
_BEYOND_MM, _MARGIN_MM = 110.0, 5.0
"""Largest extent of a picture beyond the kept points (removed points may lie anywhere), and its margin.

Chosen by hand."""
_GAP_PX = 12
"""Gap between the two views of a camera."""


def removed_table(cameras: Sequence[CameraQuality]) -> str:
    """A row for each camera: number and share of its removed points, and the number for each reason."""
    used = {reason for camera in cameras for reason, count in camera.removed.items() if count}
    reasons = [*(r for r in REASONS if r in used), *sorted(used.difference(REASONS))]
    rows = [[camera.points, *(camera.removed.get(reason, 0) for reason in reasons)] for camera in cameras]
    names = [str(camera.camera) for camera in cameras]
    if len(rows) > 1:
        rows.append([sum(column) for column in zip(*rows, strict=True)])
        names.append("All")
    cells = (
        [name, number(sum(counts)), f"{number(100 * sum(counts) / max(points, 1), 1)} %", *map(number, counts)]
        for name, (points, *counts) in zip(names, rows, strict=True)
    )
    headings = ["Camera", "Removed", "Of its points", *(text(words(reason)) for reason in reasons)]
    return table(headings, cells, numeric=range(1, len(headings)))


def removed_pictures(points: NDArray[np.void], codes: NDArray[np.uint8]) -> str:
    """Draw the points of each camera from the side and along the travel; empty without points.

    Parameters
    ----------
    points : (N,) array of `footscan.cloud.points.POINT_DTYPE`, mm, scanner frame, of all cameras, before the fusion
    codes : (N,) uint8, as in `footscan.cloud.outliers.remove.Removed`
    """
    places = coordinates(points)
    finite = np.isfinite(places).all(axis=1)
    if not finite.any():
        return ""
    kept = places[finite & (codes == KEPT)] if (codes[finite] == KEPT).any() else places[finite]
    low = np.maximum(places[finite].min(axis=0), kept.min(axis=0) - _BEYOND_MM) - _MARGIN_MM
    high = np.minimum(places[finite].max(axis=0), kept.max(axis=0) + _BEYOND_MM) + _MARGIN_MM
    inside = finite & (places >= low).all(axis=1) & (places <= high).all(axis=1)
    figures = []
    for camera in np.unique(points["camera"]).tolist():
        of_camera = points["camera"] == camera
        seen = of_camera & inside
        picture = data_uri("image/png", _picture(places[seen], codes[seen], low, high))
        beyond = int(np.count_nonzero(of_camera & ~inside))
        caption = f"{number(int(np.count_nonzero(of_camera & (codes != KEPT))))} removed" + (
            f", {number(beyond)} of them beyond the picture" if beyond else ""
        )
        figures.append(
            f"<figure><figcaption><b>Camera {camera}</b> {caption}</figcaption>"
            f'<img src="{picture}" alt="Points of camera {camera}, coloured by why they were removed"></figure>'
        )
    meanings = [("kept", _KEPT_COLOUR), *((r, _COLOURS[r]) for k, r in enumerate(REASONS, 1) if (codes == k).any())]
    return (
        key((text(words(reason)), colour) for reason, colour in meanings)
        + '<div class="clouds">\n'
        + "\n".join(figures)
        + "\n</div>"
    )


def _picture(
    places: NDArray[np.float64], codes: NDArray[np.uint8], low: NDArray[np.float64], high: NDArray[np.float64]
) -> bytes:
    """PNG of the points in the box from `low` to `high`: X right and Z up; beside it Y left and Z up."""
    long, wide, tall = np.ceil((high - low) * _PIXELS_PER_MM).astype(int) + 2
    pixels = np.full((tall, long + _GAP_PX + wide), len(REASONS) + 1, np.uint8)
    glass = round(high[2] * _PIXELS_PER_MM)
    if 0 <= glass < tall:
        pixels[glass, :long] = pixels[glass, long + _GAP_PX :] = len(REASONS) + 2
    order = np.argsort(codes, kind="stable")  # kept points are drawn first, below the removed ones
    column, across, row = ((places - low) * _PIXELS_PER_MM).astype(int)[order].T
    for down in (0, 1):
        for right in (0, 1):
            pixels[tall - 2 - row + down, column + right] = codes[order]
            pixels[tall - 2 - row + down, long + _GAP_PX + wide - 2 - across + right] = codes[order]
    image = Image.fromarray(pixels, "P")
    image.putpalette(np.array(_PALETTE, np.uint8).tobytes())
    png = io.BytesIO()
    image.save(png, "PNG", optimize=True)
    return png.getvalue()
