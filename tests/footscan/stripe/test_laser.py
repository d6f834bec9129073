"""The laser's colour: found in the frames, and the same stripe in each of them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from footscan.frames.film import open_film
from footscan.stripe.extract import extract_stripe
from footscan.stripe.laser import adapted, adapted_to, laser_of
from schemas.laser import Laser
from schemas.parameters.extraction import ExtractionParameters

Frame = NDArray[np.uint8]
CHANNELS = {"red": (0, 1, 2), "green": (1, 0, 2), "blue": (2, 1, 0)}
AUTO = ExtractionParameters()


@pytest.fixture
def red(line: Callable[..., object], light: Callable[..., object], frame: Callable[..., Frame]) -> Frame:
    return frame(light(line(20.0)), ambient=40.0, noise=2.0)


@pytest.mark.parametrize("colour", ["red", "green", "blue"])
def test_a_laser_of_each_colour_is_found_and_gives_the_same_points(red: Frame, colour: Laser) -> None:
    image = np.ascontiguousarray(red[..., CHANNELS[colour]])
    assert laser_of([image], AUTO) == colour
    points = extract_stripe(image, AUTO.with_laser(colour))
    assert len(points) > 500
    assert np.array_equal(points, extract_stripe(red, AUTO))
    off = np.full_like(image, 40)
    of_laser, of_red = (extract_stripe(*case, off) for case in ((image, AUTO.with_laser(colour)), (red, AUTO)))
    assert len(of_red) > 500
    assert np.array_equal(of_laser, of_red)


def test_a_camera_without_colours(red: Frame, line: Callable[..., object]) -> None:
    grey = np.ascontiguousarray(red[..., :1].repeat(3, axis=2))
    assert laser_of([grey], AUTO) == "mono"
    points = extract_stripe(grey, AUTO.with_laser("mono"))
    assert len(points) > 500
    assert np.abs(line(20.0)(points["i"], points["j"])).max() < 0.3  # type: ignore[operator]
    # One picture with colours: the camera has them.
    assert laser_of([grey, red], AUTO) == "red"


def test_no_stripe_no_laser(frame: Callable[..., Frame]) -> None:
    room = frame(np.zeros((480, 640)), ambient=60.0, noise=2.0)
    for frames in ([], [None], [room], [np.zeros((480, 640, 3), np.uint8)]):
        assert laser_of(frames, AUTO) is None


def test_the_film_decides_and_a_given_laser_wins(red: Frame, frame: Callable[..., Frame], tmp_path: Path) -> None:
    green = red[..., CHANNELS["green"]]
    dark = frame(np.zeros((480, 640)), noise=2.0)
    for number in range(12):
        Image.fromarray(green if 4 <= number < 8 else dark).save(tmp_path / f"{number:02}.png")
    film = open_film(tmp_path)
    assert adapted(film, AUTO).laser == "green"
    assert adapted(film, AUTO.with_laser("blue")).laser == "blue"
    assert adapted(film, ExtractionParameters(laser="red")).laser == "red"


def test_red_things_in_the_room_beside_a_green_stripe(red: Frame) -> None:
    image = red[..., CHANNELS["green"]].copy()
    image[100:160, 50:56, 0] += 80
    assert laser_of([image], AUTO) == "green"


def faint(line: Callable[..., object], light: Callable[..., object], frame: Callable[..., Frame]) -> Frame:
    return frame(light(line(20.0), amplitude=15.0), ambient=40.0, noise=0.4)


def test_a_faint_stripe_is_found(
    line: Callable[..., object], light: Callable[..., object], frame: Callable[..., Frame]
) -> None:
    image = faint(line, light, frame)
    assert len(extract_stripe(image, AUTO.with_laser("red"))) == 0
    parameters = adapted_to([image], AUTO)
    assert parameters.laser == "red"
    assert parameters.red_threshold < 8
    points = extract_stripe(image, parameters)
    assert len(points) > 500
    assert np.abs(line(20.0)(points["i"], points["j"])).max() < 0.5  # type: ignore[operator]


def test_thresholds_stay_where_the_stripe_is_strong_and_where_they_are_to_stay(
    red: Frame, line: Callable[..., object], light: Callable[..., object], frame: Callable[..., Frame]
) -> None:
    assert adapted_to([red], AUTO) == AUTO.with_laser("red")
    strict = ExtractionParameters(red_threshold=120)
    assert adapted_to([red], strict).red_threshold == 120
    fixed = ExtractionParameters(full_redness=0.0, laser="red", stripe="clear")
    assert adapted_to([faint(line, light, frame)], fixed) == fixed


def test_thresholds_stay_above_the_noise(
    line: Callable[..., object], light: Callable[..., object], frame: Callable[..., Frame]
) -> None:
    noisy = frame(light(line(20.0), amplitude=15.0), ambient=40.0, noise=6.0)
    quiet = faint(line, light, frame)
    of_noisy, of_quiet = (adapted_to([image], AUTO.with_laser("red")).red_threshold for image in (noisy, quiet))
    assert of_quiet < 8 < of_noisy


def test_thresholds_stay_in_a_room_full_of_faint_red_things(
    line: Callable[..., object], light: Callable[..., object], frame: Callable[..., Frame]
) -> None:
    room = sum(light(line(20.0, (320.0, row)), amplitude=6.0) for row in range(30, 460, 40))  # type: ignore[misc]
    image = frame(light(line(80.0), amplitude=40.0) + room, ambient=40.0, noise=0.4)
    assert adapted_to([image], AUTO).red_threshold == AUTO.red_threshold
    without = frame(light(line(80.0), amplitude=40.0), ambient=40.0, noise=0.4)
    assert adapted_to([without], AUTO).red_threshold < AUTO.red_threshold
