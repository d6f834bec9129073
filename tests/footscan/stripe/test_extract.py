"""The stripe of whole frames: centres against known lines, and what must not be taken for a stripe."""

import os
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from footscan.frames.image import pixel_buffer
from footscan.stripe.extract import extract_stripe
from footscan.stripe.points import STRIPE_DTYPE
from schemas.parameters.extraction import ExtractionParameters

PARAMETERS = ExtractionParameters()
UNSMOOTHED = ExtractionParameters(smoothing_widths=0.0)
METHODS = ["threshold-median", "gravity", "gaussian", "ridge", "fir"]
J, I = np.mgrid[0:480, 0:640].astype(float)  # noqa: E741 (the names of the axes)


def extract(image, parameters=PARAMETERS, background=None):
    points = extract_stripe(image, parameters, background)
    assert points.dtype == STRIPE_DTYPE
    assert not points["frame"].any()
    for name in STRIPE_DTYPE.names:
        assert np.isfinite(points[name]).all()
    for name in ("score", "saturation"):
        assert np.all((points[name] >= 0) & (points[name] <= 1))
    assert np.all((points["width"] > 0) & (points["sigma"] > 0))
    return points


def rms(errors):
    return np.sqrt(np.mean(np.square(errors)))


def lines_with_a_point(coordinates):
    """The number of columns (or rows) of the image that have a point."""
    return len(np.unique(np.rint(coordinates)))


def inner(points, margin=12):
    """Without those at the border, where the profile is cut off."""
    return points[(np.abs(points["i"] - 319.5) < 319.5 - margin) & (np.abs(points["j"] - 239.5) < 239.5 - margin)]


@pytest.mark.parametrize("degrees", [0, 90, 5, 30, 45, 60, 85, 120, 135, 170])
@pytest.mark.parametrize(("sigma", "too_wide"), [(1.5, 0.10), (2.5, 0.04), (4.0, 0.02)])
def test_clean_lines(line, light, frame, degrees, sigma, too_wide):
    distance = line(degrees)
    points = inner(extract(frame(light(distance, sigma))))
    errors = distance(points["i"], points["j"])
    # At 45 degrees every profile meets the pixels in the same way, and what that does to a narrow one is not averaged.
    assert abs(errors.mean()) < (0.025 if degrees in (45, 135) else 0.01)
    assert np.abs(errors).max() < 0.03
    # full width at half height of a Gaussian: 2 sqrt(2 ln 2) sigma; straight lines between samples make it wider
    np.testing.assert_allclose(points["width"], 2.3548 * sigma, rtol=too_wide)
    # one point a column, or a row, whichever the line crosses more of
    along = points["i"] if abs(np.cos(np.deg2rad(degrees))) > 0.75 else points["j"]
    assert len(points) == pytest.approx(np.ptp(along) + 1, abs=2)
    assert np.diff(np.sort(along)).max() < 1.5
    assert lines_with_a_point(along) > 0.95 * len(points)
    # in order from one end to the other
    assert np.all(np.diff(along) > 0) or np.all(np.diff(along) < 0)


@pytest.mark.parametrize("degrees", [0, 20, 90])
@pytest.mark.parametrize("method", METHODS)
def test_every_method(line, light, frame, method, degrees):
    distance = line(degrees)
    image = frame(light(distance, 2.5), noise=2.0, jpeg=True)
    points = inner(extract(image, UNSMOOTHED.model_copy(update={"centre_method": method})))
    errors = distance(points["i"], points["j"])
    assert len(points) >= 0.99 * (455 if degrees == 90 else 615)
    largest, bias = (0.35, 0.3) if method == "threshold-median" else (0.07, 0.02)
    assert rms(errors) < largest
    assert abs(errors.mean()) < bias


@pytest.mark.parametrize("degrees", [0, 30, 90])
@pytest.mark.parametrize(("sigma", "amplitude"), [(1.5, 150), (2.5, 180), (4.0, 120), (2.5, 1500), (4.0, 2500)])
def test_noise_and_jpeg(line, light, frame, degrees, sigma, amplitude):
    distance = line(degrees)
    image = frame(light(distance, sigma, amplitude), noise=2.0, jpeg=True)
    points, raw = inner(extract(image)), inner(extract(image, UNSMOOTHED))
    errors, raw_errors = distance(points["i"], points["j"]), distance(raw["i"], raw["j"])
    assert abs(errors.mean()) < 0.04
    assert rms(errors) < 0.05
    assert rms(raw_errors) < 0.10
    assert rms(errors) < rms(raw_errors)
    assert len(points) >= (452 if degrees == 90 else 610)
    # the sigma given is not far from the truth: what JPEG leaves in common to many points is no noise
    assert 0.5 < rms(raw["sigma"]) / rms(raw_errors) < 2.5


@pytest.mark.parametrize("radius", [40.0, 180.0])
@pytest.mark.parametrize("parameters", [PARAMETERS, UNSMOOTHED], ids=["smoothed", "raw"])
def test_round_a_circle(circle, light, frame, radius, parameters):
    distance = circle(radius)
    points = extract(frame(light(distance), noise=2.0), parameters)
    errors = distance(points["i"], points["j"])
    assert abs(errors.mean()) < 0.05
    assert np.abs(errors).max() < 0.15
    # one point a column or a row: 8 sin 45 degrees r in all, and nowhere a gap
    assert len(points) == pytest.approx(4 * np.sqrt(2) * radius, rel=0.02)
    angles = np.sort(np.arctan2(points["j"] - 240.7, points["i"] - 320.2))
    assert radius * np.diff(angles, append=angles[0] + 2 * np.pi).max() < 3


def test_round_a_corner(frame):
    # along row 200 from the left to column 300, then down column 300
    across = np.where(I <= 300, np.abs(J - 200), np.inf)
    down = np.where(J >= 200, np.abs(I - 300), np.inf)
    light = 180 * np.exp(-0.5 * (np.minimum(across, down) / 2.0) ** 2)
    points = inner(extract(frame(light)))
    on_row = points["i"] < 290
    on_column = points["j"] > 210
    assert np.abs(points["j"][on_row] - 200).max() < 0.03
    assert np.abs(points["i"][on_column] - 300).max() < 0.03
    assert on_row.sum() == pytest.approx(278, abs=3)
    assert on_column.sum() == pytest.approx(257, abs=3)
    corner = points[~on_row & ~on_column]
    assert 10 <= len(corner) <= 30
    assert np.minimum(np.abs(corner["j"] - 200), np.abs(corner["i"] - 300)).max() < 3


def test_two_pieces_in_one_column(line, light, frame):
    upper, lower = line(3, (320, 140)), line(-4, (320, 200))
    points = inner(extract(frame(np.maximum(light(upper), light(lower, amplitude=140)))))
    near_upper = np.abs(upper(points["i"], points["j"])) < 0.1
    near_lower = np.abs(lower(points["i"], points["j"])) < 0.1
    assert np.all(near_upper ^ near_lower)
    assert near_upper.sum() == pytest.approx(616, abs=3)
    assert near_lower.sum() == pytest.approx(616, abs=3)
    # each from end to end, one after the other
    assert np.sum(near_upper[1:] != near_upper[:-1]) == 1


def test_saturated_core_is_one_stripe(line, light, frame):
    distance = line(20)
    image = frame(light(distance, sigma=4.0, amplitude=3000))
    core = image[np.abs(distance(I, J)) < 1]
    assert core.min() > 200  # white, not red
    points = inner(extract(image))
    assert np.abs(distance(points["i"], points["j"])).max() < 0.1
    assert np.all(points["peak"] == 255)
    assert points["saturation"].min() > 0.5
    assert len(points) == pytest.approx(616, abs=5)
    dim = extract(frame(light(distance, amplitude=150)))
    assert not dim["saturation"].any()


def test_white_and_broad_red_things_are_no_stripe(line, light, frame):
    distance = line(90, (500, 240))
    ambient = np.full((480, 640, 3), 20.0)
    ambient[100:104, 50:300] = 250  # a white bar
    ambient[150:400, 60:110] = 240  # a sheet of paper
    ambient[300:, 150:400] = [180, 20, 20]  # a red holder
    points = extract(frame(light(distance), ambient, noise=1.5, jpeg=True))
    assert np.abs(distance(points["i"], points["j"])).max() < 0.5
    assert len(points) >= 470


def test_stripe_on_skin_in_bright_light(line, light, frame):
    distance = line(8)
    ambient = np.where((np.abs(J - 240) < 150)[..., np.newaxis], [190.0, 130, 110], [15.0, 15, 15])
    points = inner(extract(frame(light(distance, amplitude=120), ambient, noise=2.0, jpeg=True)))
    assert np.abs(distance(points["i"], points["j"])).max() < 0.8
    assert len(points) >= 600


def test_glints_are_dropped(line, light, frame):
    stripe = light(line(0))
    for centre in [(100, 100), (400, 60), (600, 400)]:
        stripe = np.maximum(stripe, 400 * np.exp(-0.5 * ((I - centre[0]) ** 2 + (J - centre[1]) ** 2) / 3.0**2))
    points = extract(frame(stripe))
    assert np.abs(points["j"] - 239.6).max() < 0.1


def test_ghost_is_dropped_and_a_weak_stripe_alone_is_not(line, light, frame):
    stripe, ghost = line(10, (320, 200)), line(10, (320, 225))
    faint = light(ghost, amplitude=35)
    points = extract(frame(light(stripe, amplitude=220) + faint))
    assert np.abs(stripe(points["i"], points["j"])).max() < 0.5
    alone = inner(extract(frame(faint)))
    assert np.abs(ghost(alone["i"], alone["j"])).max() < 0.3
    assert len(alone) == pytest.approx(616, abs=10)


def arc(move_i=0, move_j=0):
    """Three quarters of a circle, in an image with no noise."""
    i, j = I - move_i - 300.3, J - move_j - 230.6
    light = 180 * np.exp(-0.5 * ((np.hypot(i, j) - 80) / 2.0) ** 2) * ((i < 0) | (j < 0))
    return np.rint(light[..., np.newaxis] * [1, 0.1, 0.1] + 10).astype(np.uint8)


@settings(max_examples=15, deadline=None)
@given(st.integers(-20, 20), st.integers(-20, 20))
def test_moving_the_image_moves_the_points(half_i, half_j):
    # ridges are sought in pairs of pixels
    still, moved = extract(arc()), extract(arc(2 * half_i, 2 * half_j))
    assert len(still) == len(moved) > 300
    for points, d_i, d_j in ((still, 0, 0), (moved, 2 * half_i, 2 * half_j)):
        points["i"] -= d_i
        points["j"] -= d_j
    order, moved_order = (np.lexsort((np.round(part["j"], 3), np.round(part["i"], 3))) for part in (still, moved))
    np.testing.assert_allclose(moved["i"][moved_order], still["i"][order], atol=1e-6)
    np.testing.assert_allclose(moved["j"][moved_order], still["j"][order], atol=1e-6)


def nearest(points, others):
    """The distance of each point from the nearest of the others."""
    d_i = points["i"][:, np.newaxis] - others["i"]
    return np.hypot(d_i, points["j"][:, np.newaxis] - others["j"]).min(axis=1)


def mirrored(image, points):
    points = points.copy()
    points["i"] = image.shape[1] - 1 - points["i"]
    return image[:, ::-1], points


def transposed(image, points):
    points = points.copy()
    points["i"], points["j"] = points["j"].copy(), points["i"].copy()
    return image.transpose(1, 0, 2), points


@pytest.mark.parametrize("turn", [mirrored, transposed])
@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_turning_the_picture_turns_the_points(circle, light, frame, turn, noise):
    image = frame(light(circle(150.0)), noise=noise)
    turned, expected = turn(image, extract(image, UNSMOOTHED))
    points = extract(turned, UNSMOOTHED)
    assert len(points) == pytest.approx(len(expected), abs=6)
    # a point every 1 to 1.4 px: the same ones, but near 45 degrees, where rows are counted before columns
    assert np.mean(nearest(points, expected) < 0.01) > 0.93
    assert np.mean(nearest(expected, points) < 0.01) > 0.93


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-20, 180), st.floats(-20, 140)), min_size=2, max_size=5),
    st.floats(1.2, 5.0),
    st.floats(20, 3000),
    st.integers(0, 30),
)
def test_any_polyline_gives_points_on_it(corners, sigma, amplitude, noise):
    j, i = np.mgrid[0:121, 0:161].astype(float)

    def from_polyline(i, j):
        least = np.full(np.shape(i), np.inf)
        for (a_i, a_j), (b_i, b_j) in pairwise(corners):
            square = max((b_i - a_i) ** 2 + (b_j - a_j) ** 2, 1e-12)
            t = np.clip(((i - a_i) * (b_i - a_i) + (j - a_j) * (b_j - a_j)) / square, 0, 1)
            least = np.minimum(least, np.hypot(i - a_i - t * (b_i - a_i), j - a_j - t * (b_j - a_j)))
        return least

    distance = from_polyline(i, j)
    image = amplitude * np.exp(-0.5 * (distance / sigma) ** 2)[..., np.newaxis] * [1.0, 0.12, 0.1] + 20
    image += np.random.default_rng(noise).normal(0, 0.1 * noise, image.shape)
    points = extract(np.clip(np.rint(image), 0, 255).astype(np.uint8))
    assert np.all((points["i"] >= 0) & (points["i"] <= 160) & (points["j"] >= 0) & (points["j"] <= 120))
    # where pieces meet at an angle the light of both joins, and its ridge lies between them
    saturated = sigma * np.sqrt(2 * np.log(max(amplitude / 100, 2)))
    assert np.all(from_polyline(points["i"], points["j"]) < 2 * sigma + saturated)


@pytest.mark.parametrize(
    "shape", [(0, 0), (0, 5), (1, 1), (1, 640), (480, 1), (2, 2), (3, 8000), (33, 65), (480, 640)], ids=str
)
@pytest.mark.parametrize("kind", ["black", "white", "red", "noise"])
def test_any_image_gives_a_sane_result(shape, kind):
    generator = np.random.default_rng(3)
    image = {
        "black": np.zeros((*shape, 3)),
        "white": np.full((*shape, 3), 255),
        "red": np.broadcast_to([255, 0, 0], (*shape, 3)),
        "noise": generator.integers(0, 256, (*shape, 3)),
    }[kind].astype(np.uint8)
    points = extract(image)
    assert np.all((points["i"] >= 0) & (points["i"] <= shape[1] - 1))
    assert np.all((points["j"] >= 0) & (points["j"] <= shape[0] - 1))
    for background in (np.zeros_like(image), image):
        assert len(extract(image, PARAMETERS, background)) <= (len(points) if background.any() else image.size)
    if kind != "noise":
        assert len(points) == 0


def test_a_very_wide_image():
    j = np.arange(60)[:, np.newaxis]
    light = 200 * np.exp(-0.5 * ((j - 30.25) / 2.0) ** 2) * np.ones(8000)
    image = np.rint(light[..., np.newaxis] * [1, 0.1, 0.1] + 10).astype(np.uint8)
    points = extract(image)
    assert len(points) == pytest.approx(8000, abs=2)
    assert np.abs(points["j"] - 30.25).max() < 0.01


def test_a_view_that_is_not_contiguous(line, light, frame):
    image = frame(light(line(10)))
    turned = np.ascontiguousarray(image[::-1, ::-1])[::-1, ::-1]
    np.testing.assert_array_equal(extract(turned), extract(image))


def test_a_frame_in_a_pixel_buffer(line, light, frame):
    image = frame(light(line(10)), noise=2.0)
    buffer = pixel_buffer(480, 640)
    buffer[...] = image
    np.testing.assert_array_equal(extract(buffer), extract(image))
    np.testing.assert_array_equal(buffer, image)  # and it is as it was


def test_a_background_takes_away_what_the_room_lights(line, light, frame):
    stripe, lamp = light(line(8)), light(line(70), amplitude=150)
    room = np.where((I > 400)[..., np.newaxis], [150.0, 60, 50], [30.0, 30, 30]) + lamp[..., np.newaxis] * [1, 0.2, 0.2]
    image, background = frame(stripe, room, noise=1.5), frame(0 * stripe, room, noise=1.5)
    distance = line(8)
    without, with_it = inner(extract(image)), inner(extract(image, PARAMETERS, background))
    assert np.sum(np.abs(line(70)(without["i"], without["j"])) < 1) > 300  # red light is red light
    assert np.abs(distance(with_it["i"], with_it["j"])).max() < 0.3
    assert len(with_it) == pytest.approx(616, abs=8)
    # the laser off, and nothing else
    assert len(extract(background, PARAMETERS, background)) == 0


def test_two_threads_at_once(line, light, frame):
    images = [frame(light(line(degrees)), noise=2.0) for degrees in (0, 20, 70, 90)]
    images.append(images[1][:300, :500])
    alone = [extract(image) for image in images]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(extract, images * 4))
    for n, points in enumerate(together):
        np.testing.assert_array_equal(points, alone[n % len(images)])


@pytest.fixture
def photographs() -> Path:
    if not os.environ.get("FOOTSCAN_DATA"):
        pytest.skip("set FOOTSCAN_DATA to the folder that holds ciclop/")
    return Path(os.environ["FOOTSCAN_DATA"]) / "ciclop"


def photograph(path: Path):
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


@pytest.mark.parametrize("background", [None, "laser_background.png"])
def test_photograph_of_a_bust(photographs, background):
    """960 x 1280, an office by day: the stripe runs from the crest (588, 54) to the foot of the base (597, 1117)."""
    off = None if background is None else photograph(photographs / "object" / background)
    points = extract(photograph(photographs / "object" / "laser.png"), PARAMETERS, off)
    assert points["j"].min() < 60
    assert points["j"].max() > 1105
    assert lines_with_a_point(points["j"]) > 0.95 * (1115 - 56)
    # nowhere beside it: the cube, the holder and the rim of the turntable lie outside these columns
    assert points["i"].min() > 500
    assert points["i"].max() < 605
    # read off the photograph: the middle of the stripe at some rows
    for row, column in [(100, 556), (420, 559.5), (750, 565), (1060, 575.5)]:
        assert points["i"][np.argmin(np.abs(points["j"] - row))] == pytest.approx(column, abs=3)


@pytest.mark.parametrize(
    ("name", "ends"),
    [
        ("laser-0-255-255-8.png", [((276, 460), (272, 1030)), ((596, 465), (586, 1018))]),
        ("laser-0-255-255-8-x.png", [((315, 462), (314, 1012)), ((646, 452), (631, 1030))]),
    ],
)
def test_photographs_of_a_board(photographs, name, ends):
    """Two straight stripes on a checkerboard above a red holder; their ends are read off the photographs.

    These photographs were processed: a glare on one stripe is grey, not saturated, and its core is not found.
    """
    points = extract(photograph(photographs / "pattern" / name))
    taken = np.zeros(len(points), bool)
    for (top_i, top_j), (bottom_i, bottom_j) in ends:
        expected = top_i + (points["j"] - top_j) * (bottom_i - top_i) / (bottom_j - top_j)
        own = np.abs(points["i"] - expected) < 5
        assert lines_with_a_point(points["j"][own]) > 0.90 * (bottom_j - top_j)
        fit = np.polyfit(points["j"][own], points["i"][own], 1)
        assert np.median(np.abs(points["i"][own] - np.polyval(fit, points["j"][own]))) < 0.4
        taken |= own
    assert np.sum(~taken) < 0.08 * len(points)
