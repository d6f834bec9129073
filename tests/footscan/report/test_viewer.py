import base64
import html
import json
import re

import numpy as np

from footscan.report.viewer import Colouring, Drawing, viewer
from footscan.report.viewer_script import SCRIPT

TRIANGLE = np.array([[10, 10, 10], [16, 10, 10], [10, 18, 10]], float)


def plain(colours):
    return Colouring("", np.asarray(colours, np.uint8))


def test_the_mesh_is_on_the_page_centred_and_scaled_to_16_bits():
    vertices = np.array([[10, 10, 10], [16, 10, 10], [10, 18, 10]], float)
    page = viewer(vertices, np.array([[0, 1, 2]]), [plain([[1, 2, 3], [4, 5, 6], [7, 8, 9]])])
    data = {name: base64.b64decode(text) for name, text in re.findall(r'data-(points|faces|colours)="([^"]*)"', page)}
    # About (13, 14, 10) the corners lie at (-3, -4), (3, -4), (-3, 4), each 5 mm off, which 32767 stands for.
    x, y = round(32767 * 3 / 5), round(32767 * 4 / 5)
    assert np.frombuffer(data["points"], "<i2").tolist() == [-x, -y, 0, x, -y, 0, -x, y, 0]
    assert np.frombuffer(data["faces"], "<u2").tolist() == [0, 1, 2]
    assert np.frombuffer(data["colours"], "u1").tolist() == [1, 2, 3, 4, 5, 6, 7, 8, 9]


def test_the_script_cannot_end_its_element() -> None:
    assert "</" not in SCRIPT


def test_each_colouring_is_on_the_page_one_after_another_with_its_name_and_meaning() -> None:
    one = Colouring("Plain <b>", np.full((3, 3), 1, np.uint8), "<i>all one</i>")
    page = viewer(TRIANGLE, np.array([[0, 1, 2]]), [one, Colouring("Other", np.full((3, 3), 2, np.uint8))])
    shades = base64.b64decode(re.findall(r'data-colours="([^"]*)"', page)[0])
    assert list(shades) == [1] * 9 + [2] * 9
    assert "Plain &lt;b&gt;" in page
    assert '<div data-meaning="0"><i>all one</i></div>' in page
    assert 'data-meaning="1"' not in page
    assert 'type="radio"' not in viewer(TRIANGLE, np.array([[0, 1, 2]]), [one])


def test_drawings_and_landmarks_are_in_the_frame_of_the_points() -> None:
    drawing = Drawing([np.array([[10.0, 10, 10], [16, 18, 10]])], [np.array([13.0, 14, 10])])
    page = viewer(
        TRIANGLE, np.array([[0, 1, 2]]), [plain([[1, 2, 3]] * 3)], {'a "girth"': drawing}, {"Tip": TRIANGLE[1]}
    )
    drawn = json.loads(html.unescape(re.findall(r'data-drawings="([^"]*)"', page)[0]))
    x, y = round(32767 * 3 / 5), round(32767 * 4 / 5)
    assert drawn == {'a "girth"': {"lines": [[-x, -y, 0, x, y, 0]], "points": [[0, 0, 0]]}}
    assert json.loads(html.unescape(re.findall(r'data-landmarks="([^"]*)"', page)[0])) == {"Tip": [x, -y, 0]}


def test_a_surface_in_shreds_stays_within_16_bits():
    """30,000 separate triangles cannot be decimated: only triangles whose corners have 16-bit numbers are shown."""
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    places = np.arange(30_000)
    vertices = (corner + np.column_stack([places % 200 * 2, places // 200 * 2, places * 0])[:, None]).reshape(-1, 3)
    page = viewer(vertices, np.arange(90_000).reshape(-1, 3), [plain(np.full((90_000, 3), 9))])
    data = {name: base64.b64decode(text) for name, text in re.findall(r'data-(points|faces|colours)="([^"]*)"', page)}
    points = np.frombuffer(data["points"], "<i2").reshape(-1, 3).astype(int)
    shown = np.frombuffer(data["faces"], "<u2").reshape(-1, 3)
    assert len(shown) == 2**16 // 3
    legs = points[shown][:, 1:] - points[shown][:, :1]
    # The plane is 399 by 299 mm, and half its diagonal 32767: 1 mm is 131 or 132.
    assert set(np.abs(legs).max(axis=(1, 2))) <= {131, 132}


def test_a_large_surface_is_shown_with_fewer_triangles():
    row, column = np.divmod(np.arange(101**2), 101)
    vertices = np.column_stack([column, row, 0 * row]).astype(float)
    corner = (np.arange(100)[:, None] * 101 + np.arange(100)).ravel()
    faces = np.concatenate(
        [np.column_stack([corner, corner + 1, corner + 101]), np.column_stack([corner + 1, corner + 102, corner + 101])]
    )
    colours = np.column_stack([2 * column, row, 0 * row + 50]).astype(np.uint8)
    page = viewer(vertices, faces, [plain(colours)])
    data = {name: base64.b64decode(text) for name, text in re.findall(r'data-(points|faces|colours)="([^"]*)"', page)}
    assert len(data["faces"]) // 6 in (11_999, 12_000)
    points = np.frombuffer(data["points"], "<i2").reshape(-1, 3) / 32767 * np.hypot(50, 50) + [50, 50, 0]
    shades = np.frombuffer(data["colours"], "u1").reshape(-1, 3)
    np.testing.assert_allclose(shades[:, 0], 2 * points[:, 0], atol=3)
    assert set(shades[:, 2]) == {50}
