import base64
import io
import re

import numpy as np
import pytest
from PIL import Image

from footscan.report.surface_views import surface_views

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
OUTWARD = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
RED = 2


def pictures(vertices, faces, colours, side="right"):
    page = surface_views(vertices, faces, colours, side, last="")
    return [
        np.asarray(Image.open(io.BytesIO(base64.b64decode(encoded))))
        for encoded in re.findall(r'href="data:image/png;base64,([^"]+)"', page)
    ]


def test_each_view_has_the_axes_where_its_title_says():
    # A grey body at the origin and a red one at (200, 80, 60): toes, left, up.
    vertices = np.concatenate([TETRAHEDRON * 20, TETRAHEDRON * 20 + [200, 80, 60]])
    colours = np.repeat(np.array([[120, 120, 120], [250, 0, 0]], np.uint8), 4, axis=0)
    seen = pictures(vertices, np.concatenate([OUTWARD, OUTWARD + 4]), colours)
    places = []
    for picture in seen:
        red = (picture[..., 3] == 255) & (picture[..., 1] == 0)
        row, column = np.argwhere(red).mean(axis=0) / picture.shape[:2]
        places.append(("left" if column < 0.5 else "right", "up" if row < 0.5 else "down"))
    assert places == [
        ("right", "up"),  # from above: toes to the right, the foot's left up
        ("right", "down"),  # from below
        ("left", "up"),  # from its left: toes to the left
        ("right", "up"),  # from its right
        ("right", "up"),  # from the toes: the foot's left on the viewer's right
        ("left", "up"),  # from the heel
    ]


def test_three_pixels_are_a_mm():
    from_above = pictures(TETRAHEDRON * 100, OUTWARD, np.full((4, 3), 200, np.uint8))[0]
    rows, columns = np.nonzero(from_above[..., 3])
    assert from_above.shape == (348, 348, 4)  # 100 mm and 8 on every side
    assert abs(np.ptp(columns) + 1 - 300) <= 1
    assert abs(np.ptp(rows) + 1 - 300) <= 1
    assert abs(columns.min() - 24) <= 1


@pytest.mark.parametrize(
    ("side", "titles"),
    [
        ("right", ["Left side (medial)", "Right side (lateral)"]),
        ("left", ["Left side (lateral)", "Right side (medial)"]),
        ("unknown", ["Left side<", "Right side<"]),
    ],
)
def test_the_medial_side_is_named_by_the_foot(side, titles):
    page = surface_views(TETRAHEDRON * 10, OUTWARD, np.full((4, 3), 200, np.uint8), side, last="")
    assert all(f"<figcaption>{title}" in page for title in titles)


def test_the_grid_carries_the_foots_coordinates():
    page = surface_views(TETRAHEDRON * 100, OUTWARD, np.full((4, 3), 200, np.uint8), "right", last="")
    first = page[: page.index("</figure>")]
    # From above, X = 0 lies a margin of 8 mm from the left; figures at 0, 50 and 100, on either axis.
    assert '<path class="g5" d="M8.00 0V116.00"/>' in first
    assert '<path class="g1" d="M18.00 0V116.00"/>' in first
    assert re.findall(r">(\d+)</text>", first) == ["0", "50", "100", "0", "50", "100"]
