"""The stripe as the skeleton of the largest red part."""

import numpy as np
import pytest

from footscan.stripe.extract import extract_stripe
from footscan.stripe.film import extract_film
from schemas.parameters.extraction import ExtractionParameters

PARAMETERS = ExtractionParameters(stripe="skeleton", red_threshold=72, laser="red")


def frame(row: float, *, width: float = 2.0, columns: tuple[int, int] = (0, 96)) -> np.ndarray:
    """A Gaussian stripe along the columns, its centre at `row`."""
    image = np.zeros((64, 96, 3), np.uint8)
    light = 220.0 * np.exp(-0.5 * ((np.arange(64) - row) / width) ** 2)
    image[:, columns[0] : columns[1], 0] = light[:, None].round()
    return image


@pytest.mark.parametrize("row", [30.0, 30.5, 31.3])
def test_centres_are_right_to_a_pixel_and_whole_or_half(row: float) -> None:
    points = extract_stripe(frame(row), PARAMETERS)

    assert len(points) > 90
    assert np.all(np.abs(points["j"] - row) <= 1.0)
    assert np.all(2 * points["j"] == np.round(2 * points["j"]))
    assert np.all(np.diff(points["i"]) > 0)


def test_a_stripe_that_is_higher_than_broad_has_a_point_in_each_row() -> None:
    points = extract_stripe(frame(30.0, columns=(0, 96)).transpose(1, 0, 2).copy(), PARAMETERS)

    assert np.all(np.diff(points["j"]) > 0)
    assert np.median(points["i"]) == 30.0


def test_the_largest_part_takes_it_all_as_in_the_thesis() -> None:
    image = frame(20.0, columns=(0, 40))
    image[40:60, 50:90, 0] = 200  # a red box is larger than the stripe

    points = extract_stripe(image, PARAMETERS)

    assert points["i"].min() >= 50


@pytest.mark.parametrize("laser", ["green", "blue", "mono"])
def test_other_lasers(laser: str) -> None:
    image = frame(30.0)
    image = np.repeat(image[:, :, :1], 3, axis=2) if laser == "mono" else np.roll(image, 1 + (laser == "blue"), axis=2)

    points = extract_stripe(image, PARAMETERS.model_copy(update={"laser": laser}))

    assert np.median(points["j"]) == 30.0


def test_what_the_background_shows_is_taken_away() -> None:
    image = frame(30.0)
    lamp = np.zeros_like(image)
    lamp[0:20, 0:90, 0] = 200

    points = extract_stripe(np.maximum(image, lamp), PARAMETERS, lamp)

    assert np.median(points["j"]) == 30.0


def test_a_film_has_the_points_of_its_frames_and_none_of_a_lost_or_dark_one() -> None:
    frames = [frame(20.0), None, np.zeros((64, 96, 3), np.uint8), frame(24.0)]

    points = extract_film(frames, PARAMETERS)

    assert np.unique(points["frame"]).tolist() == [0, 3]
    assert len(points) == len(extract_stripe(frames[0], PARAMETERS)) + len(extract_stripe(frames[3], PARAMETERS))
