"""Colours of vertices: from the points on their side, evened out, continued, exposed."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.cloud.colour import linear_light
from footscan.cloud.points import make_points
from footscan.surface.texture import LIGHTEST, NEUTRAL, vertex_colours

Floats = NDArray[np.float64]
COLUMNS, ROWS, SPACING = 41, 21, 1.0
STEP = 2.0
ABOVE = {1: np.array([0.0, 0.0, 300.0]), 2: np.array([0.0, 100.0, 300.0])}
SKIN = np.array([0.4, 0.2, 0.1])


def sheet(z: float = 0.0, up: bool = True) -> dict[str, Any]:
    """A flat sheet of triangles, 40 x 20 mm, from Y = 0."""
    x, y = np.meshgrid(np.arange(COLUMNS) * SPACING, np.arange(ROWS) * SPACING, indexing="ij")
    vertices = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)])
    corner = (np.arange(COLUMNS - 1)[:, None] * ROWS + np.arange(ROWS - 1)).ravel()
    lower = np.column_stack([corner, corner + ROWS, corner + ROWS + 1])
    upper = np.column_stack([corner, corner + ROWS + 1, corner + 1])
    faces = np.concatenate([lower, upper]).astype(np.int32)
    normals = np.tile([0.0, 0.0, 1.0 if up else -1.0], (len(vertices), 1))
    filled = np.zeros(len(vertices), np.bool_)
    return {"vertices": vertices, "normals": normals, "faces": faces if up else faces[:, ::-1], "filled": filled}


def stripes(camera: int = 1, z: float = 0.0) -> NDArray[np.void]:
    """Points of a camera on the sheet, every half millimetre on stripes 2 mm apart."""
    x, y = np.meshgrid(np.arange(0, 41, STEP), np.arange(0, 20.1, 0.5), indexing="ij")
    xyz = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)])
    return make_points(xyz, camera=camera, frame=np.rint(xyz[:, 0] / STEP).astype(int))


def all_of(points: NDArray[np.void], colour: Floats) -> NDArray[np.float32]:
    return np.tile(colour, (len(points), 1)).astype(np.float32)


def light_of(levels: NDArray[np.uint8]) -> Floats:
    return linear_light(levels / 255)


def ratio(levels: NDArray[np.uint8]) -> Floats:
    """Light in parts of the red of `SKIN`, which is exposed to `LIGHTEST`."""
    return light_of(levels) * SKIN[0] / LIGHTEST


def test_skin_of_one_colour_is_exposed_and_otherwise_kept() -> None:
    points = stripes()
    levels = vertex_colours(**sheet(), points=points, colours=all_of(points, SKIN), centres=ABOVE)
    assert levels.dtype == np.uint8
    assert len(np.unique(levels, axis=0)) == 1
    np.testing.assert_allclose(ratio(levels[0]), SKIN, rtol=0.01)


def test_a_pattern_stays_where_it_is() -> None:
    """A wave of 12 mm; a mean over 2.5 mm makes it a little weaker and moves it nowhere."""
    points, mesh = stripes(), sheet()

    def wave(x: Floats) -> Floats:
        return 1 + 0.3 * np.sin(2 * np.pi * x / 12)

    colours = (SKIN * wave(points["x"].astype(np.float64))[:, None]).astype(np.float32)
    green = light_of(vertex_colours(**mesh, points=points, colours=colours, centres=ABOVE))[:, 1]
    inner = (mesh["vertices"][:, 0] > 4) & (mesh["vertices"][:, 0] < 36)
    truth = wave(mesh["vertices"][inner, 0])
    assert np.corrcoef(green[inner], truth)[0, 1] > 0.995
    weaker = np.ptp(green[inner]) / green[inner].mean() / (np.ptp(truth) / truth.mean())
    assert 0.75 < weaker < 1.0


def test_points_on_the_other_side_of_something_thin_count_nothing() -> None:
    """Two faces of a plate, 0.5 mm apart, each with a pattern of its own."""
    upper, lower = stripes(1, 0.5), stripes(5, 0.0)
    points = np.concatenate([upper, lower])
    along = np.where(points["camera"] == 1, points["x"] / 40, points["y"] / 20)
    colours = (SKIN * (0.5 + along[:, None])).astype(np.float32)
    centres = {1: ABOVE[1], 5: -ABOVE[1]}
    for mesh, camera in ((sheet(0.5), 1), (sheet(0.0, up=False), 5)):
        alone = points["camera"] == camera
        of_sheet = vertex_colours(**mesh, points=points, colours=colours, centres=centres)
        expected = vertex_colours(**mesh, points=points[alone], colours=colours[alone], centres=centres)
        np.testing.assert_array_equal(of_sheet, expected)


def test_points_off_the_surface_count_nothing() -> None:
    near, far = stripes(1), stripes(1, 1.5)
    wild = make_points(np.array([[1e30, 0, 0], [np.nan, 5, 0], [10, -1e6, 0]]), camera=1, frame=[90, 91, 92])
    points = np.concatenate([near, far, wild])
    colours = np.concatenate([all_of(near, SKIN), all_of(far, SKIN[::-1]), all_of(wild, SKIN[::-1])])
    levels = vertex_colours(**sheet(), points=points, colours=colours, centres=ABOVE)
    np.testing.assert_allclose(ratio(levels), np.tile(SKIN, (len(levels), 1)), rtol=0.02)


def test_a_camera_that_looks_squarely_counts_more() -> None:
    """At 60 degrees a view counts (0.5 - 0.1)^2 / (1 - 0.1)^2 = 0.2 of one from above. Few points keep them unequal."""
    square, oblique = stripes(1), stripes(2)
    centres = {1: np.array([0.0, 0.0, 1e6]), 2: np.array([0.0, np.sqrt(0.75) * 1e6, 0.5e6])}
    mesh = {name: values[:21] if name != "faces" else np.zeros((0, 3), np.int32) for name, values in sheet().items()}
    few = slice(0, 41)  # 21 vertices, of which fewer than 20 see both: gains are not told
    mesh["filled"] = np.arange(21) >= 10
    points = np.concatenate([square[few], oblique[few], square[41:82], oblique[41:82]])
    light, dark = [0.4, 0.4, 0.4], [0.1, 0.4, 0.4]
    colours = np.where((points["camera"] == 1)[:, None], light, dark).astype(np.float32)
    levels = vertex_colours(**mesh, points=points, colours=colours, centres=centres)
    red, green = light_of(levels[5])[:2]
    share = (0.4 / 0.9) ** 2
    assert red / green == pytest.approx((1 + share * 0.25) / (1 + share), abs=0.01)


def test_tinted_cameras_are_evened_out() -> None:
    """The second camera sees the right three quarters, tinted: no border shows."""
    first, second = stripes(1), stripes(2)
    first, second = first[first["x"] < 30], second[second["x"] > 10]
    points = np.concatenate([first, second])
    colours = np.concatenate([all_of(first, SKIN), all_of(second, SKIN * [0.5, 0.8, 1.3])])
    levels = vertex_colours(**sheet(), points=points, colours=colours, centres=ABOVE)
    assert np.ptp(levels.astype(int), axis=0).max() <= 1


def test_what_was_cut_off_gives_way() -> None:
    first, second = stripes(1), stripes(2)
    points = np.concatenate([first, second])
    colours = np.concatenate([all_of(first, SKIN), all_of(second, np.ones(3))])
    one = vertex_colours(**sheet(), points=first, colours=colours[: len(first)], centres=ABOVE)
    both = vertex_colours(**sheet(), points=points, colours=colours, centres=ABOVE)
    parts = light_of(both) / light_of(both)[:, :1]
    np.testing.assert_allclose(parts, light_of(one) / light_of(one)[:, :1], rtol=0.02)


def test_filled_vertices_continue_what_is_around_them() -> None:
    """Across a gap light grows evenly from its left rim to its right one; points within it are not used."""
    mesh, points = sheet(), stripes()
    x = mesh["vertices"][:, 0]
    mesh["filled"] = (x > 10) & (x < 30)
    amount = np.where(points["x"] < 11, 0.5, np.where(points["x"] > 29, 1.0, 0.0))
    levels = vertex_colours(**mesh, points=points, colours=(SKIN * amount[:, None]).astype(np.float32), centres=ABOVE)
    red = light_of(levels)[:, 0].reshape(COLUMNS, ROWS).mean(axis=1)
    assert red[0] == pytest.approx(LIGHTEST / 2, abs=0.01)
    assert red[40] == pytest.approx(LIGHTEST, abs=0.01)
    rims = red[10], red[30]
    np.testing.assert_allclose(red[10:31], np.linspace(*rims, 21), atol=0.01)


def test_skin_whose_camera_has_no_laser_off_frames_takes_the_colour_of_what_is_near() -> None:
    points = stripes()
    points = points[points["x"] < 12]
    levels = vertex_colours(**sheet(), points=points, colours=all_of(points, SKIN), centres=ABOVE)
    assert len(np.unique(levels, axis=0)) == 1


def test_the_flat_cut_is_grey_inside_its_rim() -> None:
    mesh, points = sheet(), stripes()
    points = points[points["x"] <= 20]
    x = mesh["vertices"][:, 0]
    mesh["vertices"][:, 2] = np.maximum(20 - x, 0) * 0.01  # the cut is what lies at 0, from X = 20 on
    mesh["filled"] = x >= 20
    levels = vertex_colours(**mesh, points=points, colours=all_of(points, SKIN), centres=ABOVE, cut_mm=0.0)
    is_grey = (levels == NEUTRAL).all(axis=1)
    np.testing.assert_array_equal(is_grey, x > 20)


def test_dark_films_are_brightened_but_night_is_not() -> None:
    points = stripes()
    reds = [
        light_of(vertex_colours(**sheet(), points=points, colours=all_of(points, SKIN * factor), centres=ABOVE))[0, 0]
        for factor in (0.1, 0.001)
    ]
    np.testing.assert_allclose(reds, [LIGHTEST, LIGHTEST * 0.04], rtol=0.05)


@pytest.mark.parametrize("what", ["no points", "all filled", "no camera looks at it"])
def test_all_is_grey_where_nothing_is_known(what: str) -> None:
    mesh, points = sheet(up=what != "no camera looks at it"), stripes()
    if what == "no points":
        points = points[:0]
    mesh["filled"][:] = what == "all filled"
    levels = vertex_colours(**mesh, points=points, colours=all_of(points, SKIN), centres=ABOVE)
    assert (levels == NEUTRAL).all()


def test_the_same_bytes_again_and_without_known_places() -> None:
    points = stripes()
    colours = np.random.default_rng(0).uniform(0.1, 0.5, (len(points), 3)).astype(np.float32)
    once, again, unknown = (
        vertex_colours(**sheet(), points=points, colours=colours, centres=centres) for centres in (ABOVE, ABOVE, {})
    )
    np.testing.assert_array_equal(once, again)
    np.testing.assert_allclose(light_of(unknown), light_of(once), atol=0.02)  # one camera, from above: little changes
