"""Colours of stripe points from laser-off frames, and the gains of cameras."""

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.cloud.colour import as_level, camera_gains, linear_light, point_colours
from footscan.stripe.points import STRIPE_DTYPE
from footscan.virtual.filming.render import CameraRenderer
from footscan.virtual.optics.scanner import standard_scanner
from footscan.virtual.optics.scene import SKIN as SKIN_SURFACE
from footscan.virtual.optics.scene import Mesh, Scene
from footscan.virtual.optics.texture import random_texture
from footscan.virtual.stage.block import make_block
from schemas.parameters.simulation import SimulationSettings

Image = NDArray[np.uint8]
SKIN = (180, 130, 110)


def stripe(*points: tuple[int, float, float], width: float = 2.0) -> NDArray[np.void]:
    """Points (frame, i, j) of one width, px."""
    made = np.zeros(len(points), STRIPE_DTYPE)
    for row, (frame, i, j) in zip(made, points, strict=True):
        row["frame"], row["i"], row["j"], row["width"] = frame, i, j, width
    return made


def picture(colour: tuple[int, int, int] = (0, 0, 0)) -> Image:
    return np.full((20, 30, 3), colour, np.uint8)


def light_of(levels: tuple[int, ...]) -> NDArray[np.float64]:
    return linear_light(np.array(levels) / 255)


def test_the_curve_of_light() -> None:
    """Middle grey of a picture is a fifth of its white; the straight part of the curve ends at 0.04045."""
    np.testing.assert_allclose(linear_light(np.array([0, 0.04045, 0.5, 1])), [0, 0.0031308, 0.2140411, 1], atol=1e-7)
    levels = np.arange(256) / 255
    np.testing.assert_allclose(as_level(linear_light(levels)), levels, atol=1e-6)


def test_between_pixels_a_narrow_stripe_has_the_mean_of_four_in_linear_light() -> None:
    frame = picture()
    frame[5, 10] = (100, 200, 50)
    colours, seen = point_colours(stripe((0, 10.25, 5.5), (0, 9.0, 5.0)), lambda _: frame)
    np.testing.assert_allclose(colours[0], 0.75 * 0.5 * light_of((100, 200, 50)), rtol=1e-6)
    np.testing.assert_array_equal(colours[1], 0)
    assert seen.all()


def test_a_wide_stripe_averages_more_pixels_but_not_beyond_three() -> None:
    frame = picture()
    frame[5, 12] = (100, 100, 100)
    at = (0, 10.0, 5.0)
    of_width = {width: point_colours(stripe(at, width=width), lambda _: frame)[0][0, 0] for width in (4, 5, 6, 40)}
    # Under a pyramid of half-width h a pixel two columns away counts (h - 2) h of the sum of all, which is
    # 1 + 2 + 1 squared for h = 2, and 1 + 2 + 3 + 2 + 1 squared for h = 3.
    assert of_width[4] == 0
    assert of_width[6] == pytest.approx(light_of((100,))[0] * 1 * 3 / 81, rel=1e-6)
    assert 0 < of_width[5] < of_width[6] == of_width[40]


def test_pixels_that_are_cut_off_count_where_there_are_no_others() -> None:
    frame = picture(SKIN)
    frame[:, 11:] = 255
    frame[10:] = 255
    colours, _ = point_colours(stripe((0, 10.5, 5.0), (0, 20.0, 15.0)), lambda _: frame)
    np.testing.assert_allclose(colours[0], light_of(SKIN), rtol=0.01)
    np.testing.assert_allclose(colours[1], 1.0)


def test_points_without_a_frame_or_beside_it_have_no_colour() -> None:
    asked: list[int] = []

    def laser_off(number: int) -> Image | None:
        asked.append(number)
        return picture(SKIN) if number == 7 else None

    points = stripe((7, 29.0, 19.0), (3, 5.0, 5.0), (7, 29.1, 5.0), (7, -0.1, 5.0), (7, np.nan, 5.0), (7, 0.0, 0.0))
    colours, seen = point_colours(points, laser_off)
    assert asked == [3, 7]
    assert seen.tolist() == [True, False, False, False, False, True]
    np.testing.assert_allclose(colours[seen], np.tile(light_of(SKIN), (2, 1)), rtol=1e-6)
    assert not colours[~seen].any()


def test_no_points() -> None:
    colours, seen = point_colours(stripe(), lambda _: None)
    assert colours.shape == (0, 3)
    assert seen.shape == (0,)


def test_a_frame_that_shares_its_memory_with_the_next() -> None:
    memory = picture()

    def laser_off(number: int) -> Image:
        memory[:] = 50 * number
        return memory

    colours, _ = point_colours(stripe((1, 5.0, 5.0), (2, 5.0, 5.0)), laser_off)
    np.testing.assert_allclose(colours[:, 0], light_of((50, 100)), rtol=1e-6)


def observed(gains: NDArray[np.float64], sees: list[slice], seed: int = 0) -> NDArray[np.float64]:
    """Sums as cameras with these factors make them that see stretches of 900 vertices, a tenth of them glinting."""
    random = np.random.default_rng(seed)
    skin = random.uniform(0.05, 0.5, (900, 3))
    sums = np.zeros((900, len(gains), 4))
    for k, stretch in enumerate(sees):
        weight = random.uniform(0.5, 5.0, 900)[stretch]
        light = (skin * gains[k] * random.lognormal(0.0, 0.02, (900, 3)))[stretch]
        light[random.random(len(light)) < 0.1] += 0.5
        sums[stretch, k] = np.column_stack([light * weight[:, None], weight])
    return sums


def test_gains_are_found_along_a_chain_of_cameras_in_spite_of_glints() -> None:
    gains = np.array([[1.0, 1.0, 1.0], [1.6, 1.1, 0.7], [0.5, 0.6, 0.8]])
    found = camera_gains(observed(gains, [slice(0, 400), slice(200, 700), slice(500, 900)]))
    truth = np.log(gains) - np.log(gains).mean(axis=0)
    np.testing.assert_allclose(found, truth, atol=0.03)
    np.testing.assert_allclose(found.mean(axis=0), 0, atol=1e-12)


def test_cameras_that_share_nothing_keep_their_brightness() -> None:
    gains = np.array([[2.0] * 3, [1.0] * 3, [0.25] * 3])
    found = camera_gains(observed(gains, [slice(0, 400), slice(300, 600), slice(590, 900)]))
    np.testing.assert_allclose(found[0] - found[1], np.log(2), atol=0.03)
    np.testing.assert_allclose(found[0] + found[1], 0, atol=1e-9)
    np.testing.assert_allclose(found[2], 0, atol=1e-12)


def test_gains_of_one_camera_and_of_none() -> None:
    assert camera_gains(observed(np.ones((1, 3)), [slice(0, 900)])).tolist() == [[0, 0, 0]]
    assert camera_gains(np.zeros((5, 0, 4))).shape == (0, 3)


def test_the_virtual_scanner_shows_the_texture_of_a_block() -> None:
    """On its flat top all unevenness is the texture's."""
    settings = SimulationSettings(laser_exposure=0.0, texture=3.0)
    vertices, faces = make_block((60.0, 40.0, 30.0))
    scene = Scene(Mesh(vertices, faces.astype(np.int64)), SKIN_SURFACE)
    texture = random_texture(settings.seed, SKIN_SURFACE.unevenness * settings.texture)
    scanner = standard_scanner(settings.scanner_seed)
    renderer = CameraRenderer(scanner, 1, settings, texture)
    stations = (20.0, 30.0, 40.0)
    y = np.arange(-15.0, 15.0, 0.25)
    heads = np.column_stack([np.zeros_like(y), y, np.full_like(y, 30.0)])  # the laser's line on the top
    i, j = scanner.camera(1).project(heads).T
    points = stripe(*((frame, *place) for frame in range(3) for place in zip(i, j, strict=True)), width=5.0)
    colours, seen = point_colours(points, lambda frame: renderer.picture(scene, stations[frame], frame))
    assert seen.all()
    truth = texture.at(np.concatenate([heads + np.array([x, 0.0, 0.0]) for x in stations]))
    assert np.corrcoef(colours[:, 1], truth)[0, 1] > 0.93
    off = colours[:, 1] / np.median(colours[:, 1]) / (truth / np.median(truth)) - 1
    assert np.sqrt(np.mean(off**2)) < 0.06
