"""A picture of what a session has filmed so far: the stripes of all placements in the image of each camera."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.region import region_of

Floats = NDArray[np.float64]

COLUMNS = 4
"""Panels in a row."""
WIDTH, GAP, CAPTION = 240, 12, 18
"""Width of a panel, distance of panels and height of a caption, px of the picture."""
INK, PAPER, COVERED, LATEST, REGION = "#444", "#fff", "#3d7ea6", "#e0590b", "#dcecf5"
THINNED = 4
"""One of so many points is drawn: enough for a line."""


def covered_share(stripe: Floats, image_px: tuple[int, int]) -> float:
    """Compute the share of an image of (columns, rows) that lies between points (N, 2), px: within their hull.

    >>> print(covered_share(np.array([[0.0, 0.0], [320.0, 0.0], [320.0, 240.0], [0.0, 240.0]]), (640, 480)))
    0.25
    """
    hull = np.array(region_of(stripe)).reshape(-1, 2)
    i, j = hull.T
    area = 0.5 * abs(float(np.sum(i * np.roll(j, -1) - j * np.roll(i, -1))))
    return area / (image_px[0] * image_px[1])


def coverage_picture(
    image_px: Mapping[int, tuple[int, int]], covered: Mapping[int, Floats], latest: Mapping[int, Floats]
) -> str:
    """Draw a panel for each camera as SVG: the stripes (N, 2), px, and the region between them.

    Parameters
    ----------
    image_px : columns and rows of each camera
    covered : by camera, the stripes of all placements as far as they lie on the object
    latest : by camera, the whole stripe in the latest placement
    """
    panels, bottom = [], 0.0
    height = WIDTH * max((rows / columns for columns, rows in image_px.values()), default=0.75)
    for place, (camera, (columns, rows)) in enumerate(sorted(image_px.items())):
        x, y = (place % COLUMNS) * (WIDTH + GAP), (place // COLUMNS) * (height + CAPTION + GAP)
        bottom = max(bottom, y + height + CAPTION)
        old, new = covered.get(camera, np.empty((0, 2))), latest.get(camera, np.empty((0, 2)))
        corners = " ".join(f"{i:.0f},{j:.0f}" for i, j in region_of(old))
        share = covered_share(old, (columns, rows))
        panels.append(
            f'<g transform="translate({x:g} {y:g})"><text y="13">Camera {camera}: {100 * share:.0f} %</text>'
            f'<svg y="{CAPTION}" width="{WIDTH}" height="{WIDTH * rows / columns:g}" viewBox="0 0 {columns} {rows}">'
            f'<rect width="{columns}" height="{rows}" fill="{PAPER}" stroke="{INK}" stroke-width="4"/>'
            f'<polygon points="{corners}" fill="{REGION}"/>{_dots(old, COVERED)}{_dots(new, LATEST)}</svg></g>'
        )
    across = min(len(image_px), COLUMNS) * (WIDTH + GAP) - GAP
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {max(across, 1):g} {max(bottom, 1):g}" '
        f'font-family="sans-serif" font-size="13" fill="{INK}">{"".join(panels)}</svg>'
    )


def _dots(stripe: Floats, colour: str) -> str:
    dots = "".join(f"M{i:.0f} {j:.0f}h0" for i, j in stripe[::THINNED].tolist())
    return f'<path d="{dots}" stroke="{colour}" stroke-width="5" stroke-linecap="round" fill="none"/>' if dots else ""
