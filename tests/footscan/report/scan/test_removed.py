import base64
import io
import re

import numpy as np
from PIL import Image

from footscan.cloud.outliers.remove import REASONS
from footscan.cloud.points import make_points
from footscan.report.scan.removed import removed_pictures, removed_table
from schemas.quality import CameraQuality

GLASS, VOLUME = (1 + REASONS.index(reason) for reason in ("glass", "volume"))


def pictures_of(markup):
    found = re.findall(r'src="data:image/png;base64,([^"]*)"', markup)
    return [np.array(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")) for data in found]


def colour_of(markup, meaning):
    return tuple(int(part) for part in re.search(rf"rgb\(([^)]*)\)\"></i>{meaning}<", markup)[1].split(","))


def test_removed_points_have_the_colour_of_their_reason_where_they_were():
    # Camera 1: 100 mm of kept points at Z = 20; camera 2: the same, and its mirror image.
    kept = np.column_stack([np.arange(101), np.zeros(101), np.full(101, 20.0)])
    points = np.concatenate(
        [make_points(kept, camera=1), make_points(kept, camera=2), make_points(kept * [1, 1, -1], camera=2)]
    )
    markup = removed_pictures(points, np.repeat(np.array([0, 0, GLASS], np.uint8), 101))
    first, second = pictures_of(markup)
    colour, glass = colour_of(markup, "Kept"), colour_of(markup, "Glass")
    assert "Volume" not in markup
    assert not (first == glass).all(axis=2).any()
    rows, columns = np.nonzero((second == glass).all(axis=2))
    above = np.nonzero((second == colour).all(axis=2))[0]
    assert np.isclose(rows.mean() - above.mean(), 40 * 1.5, atol=2)
    side = columns < (100 + 2 * 5) * 1.5 + 2
    assert np.isclose(np.ptp(columns[side]), 100 * 1.5, atol=2)
    assert np.ptp(columns[~side]) <= 2  # along the travel they lie behind each other


def test_along_the_travel_y_runs_to_the_left():
    points = make_points(np.array([[0, 0, 0], [0, 50, 0], [0, 50, 1]]), camera=3)
    markup = removed_pictures(points, np.array([0, GLASS, 0], np.uint8))
    (picture,) = pictures_of(markup)
    removed = np.nonzero((picture == colour_of(markup, "Glass")).all(axis=2))[1]
    kept = np.nonzero((picture == colour_of(markup, "Kept")).all(axis=2))[1]
    assert kept.max() - removed.max() >= 70


def test_what_lies_elsewhere_is_counted():
    points = make_points(np.array([[0, 0, 0], [1, 1, 1], [9e4, 0, 0], [np.nan, 0, 0]]), camera=5)
    markup = removed_pictures(points, np.array([0, 0, VOLUME, VOLUME], np.uint8))
    assert "2 removed, 2 of them beyond the picture" in markup
    assert pictures_of(markup)[0].size < 1e6


def test_no_points_no_pictures():
    assert removed_pictures(make_points(np.zeros((0, 3)), camera=1), np.zeros(0, np.uint8)) == ""


def test_a_camera_without_points_has_removed_no_share():
    camera = CameraQuality(camera=4, frames=3, frames_lost=0, frames_with_stripe=0, points=0, removed={})
    assert ">0.0 %<" in removed_table([camera])
