"""Whole films: a stripe that moves, a glint that does not."""

import numpy as np
import pytest

from footscan.frames.image import pixel_buffer
from footscan.stripe.extract import extract_stripe
from footscan.stripe.film import CSV_COLUMNS, extract_film, points_csv
from footscan.stripe.points import STRIPE_DTYPE
from schemas.parameters.extraction import ExtractionParameters

PARAMETERS = ExtractionParameters()
ROWS, COLUMNS = 120, 160
J, I = np.mgrid[0:ROWS, 0:COLUMNS].astype(float)  # noqa: E741 (the names of the axes)


def coloured(light, ambient=15.0):
    return np.clip(np.rint(light[..., np.newaxis] * [1.0, 0.1, 0.1] + ambient), 0, 255).astype(np.uint8)


def stripe(j, start=-20.0, end=200.0):
    light = 180 * np.exp(-0.5 * ((J - j) / 2.0) ** 2)
    return np.where((start <= I) & (end >= I), light, 0)


def place_of(k):
    return 30.3 + 2 * k


def test_frames_are_numbered_and_lost_ones_are_passed_over():
    frames = [None if k in (0, 4, 5) else coloured(stripe(place_of(k))) for k in range(12)]
    points = extract_film(frames, PARAMETERS)
    assert points.dtype == STRIPE_DTYPE
    assert np.unique(points["frame"]).tolist() == [1, 2, 3, 6, 7, 8, 9, 10, 11]
    assert np.all(np.diff(points["frame"]) >= 0)
    assert np.abs(points["j"] - place_of(points["frame"])).max() < 0.05
    for k in (1, 11):
        alone = extract_stripe(frames[k], PARAMETERS)
        alone["frame"] = k
        np.testing.assert_array_equal(points[points["frame"] == k], alone)


def test_frames_may_share_one_buffer():
    frames = [coloured(stripe(place_of(k))) for k in range(5)]

    def read():
        buffer = pixel_buffer(ROWS, COLUMNS)
        for frame in frames:
            buffer[...] = frame
            yield buffer
            buffer[...] = 0

    np.testing.assert_array_equal(extract_film(read(), PARAMETERS), extract_film(frames, PARAMETERS))


def test_a_glint_goes_and_the_stripe_stays():
    glint = 250 * np.exp(-0.5 * ((J - 100) / 2.0) ** 2) * ((I > 60) & (I < 85))
    alone = extract_stripe(coloured(glint), PARAMETERS)
    assert len(alone) > 15  # in one frame it looks like a stripe
    points = extract_film((coloured(np.maximum(stripe(place_of(k)), glint)) for k in range(20)), PARAMETERS)
    assert points["j"].max() < 80
    assert len(points) == pytest.approx(20 * COLUMNS, rel=0.03)


def test_what_comes_in_one_frame_alone_goes():
    once = 250 * np.exp(-0.5 * ((J - 100) / 2.0) ** 2) * ((I > 60) & (I < 85))
    lit = [stripe(place_of(k)) for k in range(9)]
    lit[4] = np.maximum(lit[4], once)
    assert extract_film(map(coloured, lit), PARAMETERS)["j"].max() < 80


def test_the_rim_of_lit_skin_goes_by_the_stripe_of_the_whole_film():
    # it moves and goes on as the stripe does, but is wider; its place changes along it, and it is hardly red
    wander = np.random.default_rng(3).normal(0, 1.5, COLUMNS).cumsum()

    def rim(k):
        along = np.exp(-0.5 * ((J - 70 - 2 * k - wander + wander.mean()) / 5.0) ** 2) * ((I > 40) & (I < 120))
        return 32 * along[..., np.newaxis] * [1.0, 0.2, 0.2]

    frames = [coloured(stripe(place_of(k)) if k < 14 else 0 * J) for k in range(14)]
    lit = [np.clip(15 + rim(k), 0, 255).astype(np.uint8) for k in range(6)]
    assert min(len(extract_stripe(frame, PARAMETERS)) for frame in lit) > 40  # in one frame it looks like a stripe
    assert np.unique(extract_film([*frames, *lit], PARAMETERS)["frame"]).tolist() == list(range(14))
    kept = extract_film([*frames, *lit], PARAMETERS.model_copy(update={"largest_blur": 100.0}))
    assert np.unique(kept["frame"]).tolist() == list(range(20))


def test_a_lost_frame_does_not_part_the_frames_beside_it():
    part = [stripe(place_of(k), 60, 90) for k in range(5)]  # short: kept only where it is followed
    frames = [coloured(part[0]), None, coloured(part[1]), None, coloured(part[2])]
    assert np.unique(extract_film(frames, PARAMETERS)["frame"]).tolist() == [0, 2, 4]


def test_backgrounds_take_away_what_the_room_lights():
    # a red bar that no laser lit, a stripe's width and moving with the camera
    def bar(k):
        return 150 * np.exp(-0.5 * ((I - 40 - 3 * k) / 2.0) ** 2) * (J > 50)

    frames = [coloured(np.maximum(stripe(place_of(0)), bar(k))) for k in range(6)]
    backgrounds = [coloured(bar(k)) for k in range(6)]
    without = extract_film(frames, PARAMETERS)
    assert np.sum(without["j"] > 60) > 6 * 40
    points = extract_film(frames, PARAMETERS, backgrounds)
    assert points["j"].max() < 40
    assert len(points) == pytest.approx(6 * COLUMNS, rel=0.03)
    some = extract_film(frames, PARAMETERS, [None, *backgrounds[1:]])
    np.testing.assert_array_equal(some[some["frame"] > 0], points[points["frame"] > 0])


def test_films_without_a_stripe():
    dark = np.zeros((ROWS, COLUMNS, 3), np.uint8)
    for frames in ([], [None], [None, dark, None], [dark] * 10):
        points = extract_film(frames, PARAMETERS)
        assert points.dtype == STRIPE_DTYPE
        assert len(points) == 0


def test_csv():
    points = np.zeros(2, STRIPE_DTYPE)
    points[0] = (3, 1.23456, 7.0, 4.5, 255, 0.98765, 0.5, 0.03)
    points[1]["frame"] = 199
    lines = points_csv(points).splitlines()
    assert lines[0] == ",".join(CSV_COLUMNS) == "frame,i,j,width,peak,score"
    assert lines[1] == "3,1.235,7.000,4.500,255.000,0.988"
    assert lines[2] == "199,0.000,0.000,0.000,0.000,0.000"
    assert points_csv(np.zeros(0, STRIPE_DTYPE)) == "frame,i,j,width,peak,score\n"
