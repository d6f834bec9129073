"""Faint lines on photographs of boards: drawn here, with mosaic and compression, unlike the pictures of the scanner."""

from dataclasses import dataclass

import numpy as np
import pytest
import simplejpeg
from numpy.typing import NDArray
from scipy import ndimage

from footscan.stripe.extract import extract_stripe
from footscan.stripe.laser import adapted_to
from footscan.stripe.points import StripePoints
from schemas.parameters.extraction import ExtractionParameters

ROWS, COLUMNS = 480, 640
J, I = np.mgrid[0:ROWS, 0:COLUMNS].astype(float)  # noqa: E741 (the name of the axis)
PAPER = 0.006
"""Standard deviation of the paper's grey texture, relative to its level."""


@dataclass(frozen=True)
class Board:
    """A photograph of a white board with a printed chessboard and a line of laser light, and the same without it."""

    picture: NDArray[np.uint8]
    laser_off: NDArray[np.uint8]
    white: NDArray[np.bool_]
    normal: tuple[float, float]
    offset: float
    bound_px: float
    """Cramer-Rao bound of the centre in one column: noise / height * sqrt(2 sigma / sqrt(pi))."""

    def distance(self, points: StripePoints) -> NDArray[np.float64]:
        return (points["i"] - 320) * self.normal[0] + (points["j"] - 240) * self.normal[1] - self.offset

    def covered(self, points: StripePoints) -> float:
        """The part of the line on white that has points within 3 px."""
        own = np.abs((I - 320) * self.normal[0] + (J - 240) * self.normal[1] - self.offset) < 0.6
        axis = 1 if abs(self.normal[1]) > abs(self.normal[0]) else 0
        near = points[np.abs(self.distance(points)) < 3]
        seen = np.rint(near["i" if axis == 1 else "j"]).astype(int)
        line = np.nonzero((own & self.white).any(axis=1 - axis))[0]
        return float(np.isin(line, seen).mean())


def photographed(seed: int, height: float, sigma: float, compressed: bool, channel: int = 1) -> Board:
    random = np.random.default_rng(seed)
    tilt, side = np.deg2rad(random.uniform(-15, 15)), random.uniform(26, 40)
    u, v = ((I - 320) * np.cos(tilt) + (J - 240) * np.sin(tilt)), ((J - 240) * np.cos(tilt) - (I - 320) * np.sin(tilt))
    board = (np.abs(u) < 260) & (np.abs(v) < 190)
    printed = (np.abs(u) < 4 * side) & (np.abs(v) < 3 * side)
    black = printed & ((np.floor(u / side) + np.floor(v / side)) % 2 == 0)
    reflectance = ndimage.gaussian_filter(np.where(board, np.where(black, 0.15, 1.0), 0.25), 0.8)
    texture = ndimage.gaussian_filter(random.normal(size=(ROWS, COLUMNS)), 0.8)
    light = 1 + 0.15 * random.uniform(-1, 1) * (I - 320) / 320 + 0.15 * random.uniform(-1, 1) * (J - 240) / 240
    surface = random.uniform(130, 190) * light * (1 + PAPER / texture.std() * texture) * reflectance
    picture = surface[..., np.newaxis] * (1 + random.uniform(-0.05, 0.05, 3))
    angle = np.deg2rad(random.uniform(60, 120))
    normal, offset = (-np.sin(angle), np.cos(angle)), random.uniform(-60, 60)
    across = (I - 320) * normal[0] + (J - 240) * normal[1] - offset
    share = np.array([0.2, 0.2, 0.2])
    share[channel] = 1.0
    line = height * np.exp(-0.5 * (across / sigma) ** 2) * reflectance * board
    noise = 1.2
    whole = np.hypot(noise, PAPER * 160)
    return Board(
        developed(picture + line[..., np.newaxis] * share, random, noise, compressed),
        developed(picture, random, noise, compressed),
        board & ~black,
        normal,
        offset,
        whole / height * np.sqrt(2 * sigma / np.sqrt(np.pi)),
    )


def developed(
    light: NDArray[np.float64], random: np.random.Generator, noise: float, compressed: bool
) -> NDArray[np.uint8]:
    """A mosaic (RG over GB) with noise, interpolated, and compressed to JPEG with a colour for four pixels."""
    noisy = light + random.normal(0.0, noise, light.shape)
    kernel = np.array([[1.0, 2.0, 1.0], [2.0, 4.0, 2.0], [1.0, 2.0, 1.0]])
    colours = np.array([[0, 1], [1, 2]])[np.arange(ROWS)[:, None] % 2, np.arange(COLUMNS) % 2]
    picture = np.empty_like(light)
    for channel in range(3):
        own = (colours == channel).astype(float)
        picture[..., channel] = ndimage.convolve(noisy[..., channel] * own, kernel) / ndimage.convolve(own, kernel)
    pixels = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    if compressed:
        pixels = simplejpeg.decode_jpeg(simplejpeg.encode_jpeg(pixels, 92, "RGB", "420"), "RGB")
    return pixels


def test_lines_on_boards_are_found_and_are_straight() -> None:
    found, ratios = 0, []
    random = np.random.default_rng(77)
    for seed in range(20):
        board = photographed(seed, random.uniform(5, 25), random.uniform(0.8, 1.5), compressed=False)
        points = extract_stripe(board.picture, ExtractionParameters())
        distance = board.distance(points)
        near = np.abs(distance) < 3
        found += bool(board.covered(points) > 0.3 and near.mean() > 0.9)
        if near.sum() > 50:
            inside = distance[near] - np.median(distance[near])
            ratios.append(np.sqrt(np.mean(np.clip(inside, -1, 1) ** 2)) / board.bound_px)
    assert found >= 19
    assert np.median(ratios) < 1.2


@pytest.mark.parametrize("channel", [0, 1])
def test_lines_on_compressed_boards_are_found(channel: int) -> None:
    found = 0
    for seed in range(10):
        board = photographed(100 + seed, 20.0, 1.2, compressed=True, channel=channel)
        parameters = adapted_to([board.picture], ExtractionParameters())
        points = extract_stripe(board.picture, parameters)
        found += bool(board.covered(points) > 0.3 and np.mean(np.abs(board.distance(points)) < 3) > 0.8)
        found_colour = parameters.laser == ("red", "green")[channel]
        assert found_colour or board.covered(points) < 0.3
    assert found >= (8 if channel == 1 else 5)  # compression hides some; cameras keep less red than green


def test_boards_without_a_line_have_none() -> None:
    empty = [photographed(200 + seed, 0.01, 1.2, compressed=False).laser_off for seed in range(10)]
    assert sum(len(extract_stripe(picture, ExtractionParameters())) > 0 for picture in empty) <= 1


def test_a_clear_stripe_stays_clear(line, light, frame) -> None:
    assert adapted_to([frame(light(line(20.0)))], ExtractionParameters()).stripe == "auto"
    chosen = ExtractionParameters(stripe="clear")
    board = photographed(1, 20.0, 1.2, compressed=False)
    assert board.covered(extract_stripe(board.picture, chosen)) < 0.1
