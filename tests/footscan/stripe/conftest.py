"""Frames of a plain kind: a red stripe of Gaussian profile over grey, with its centre known."""

from collections.abc import Callable

import numpy as np
import pytest
import simplejpeg
from numpy.typing import NDArray

ROWS, COLUMNS = 480, 640
Distance = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
"""The signed distance in px of (i, j) from the centre line of a stripe."""


def _line(degrees: float, through: tuple[float, float] = (319.3, 239.6)) -> Distance:
    normal_i, normal_j = -np.sin(np.deg2rad(degrees)), np.cos(np.deg2rad(degrees))
    return lambda i, j: (i - through[0]) * normal_i + (j - through[1]) * normal_j


def _circle(radius: float, centre: tuple[float, float] = (320.2, 240.7)) -> Distance:
    return lambda i, j: np.hypot(i - centre[0], j - centre[1]) - radius


def _light(distance: Distance, sigma: float = 2.0, amplitude: float = 180.0) -> NDArray[np.float64]:
    """(ROWS, COLUMNS): the laser light in red, grey levels before saturation."""
    j, i = np.mgrid[0:ROWS, 0:COLUMNS].astype(float)
    return amplitude * np.exp(-0.5 * (distance(i, j) / sigma) ** 2)


def _frame(
    light: NDArray[np.float64], ambient: object = 20.0, noise: float = 0.0, jpeg: bool = False
) -> NDArray[np.uint8]:
    """An RGB frame: an eighth of the light leaks into green and blue, which makes a saturated core white."""
    image = light[..., np.newaxis] * [1.0, 0.12, 0.1] + np.asarray(ambient)
    image = image + np.random.default_rng(1).normal(0.0, noise, image.shape)
    pixels = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    if jpeg:
        pixels = simplejpeg.decode_jpeg(simplejpeg.encode_jpeg(pixels, 85, "RGB", "420"), "RGB")
    return pixels


@pytest.fixture(scope="session")
def line() -> Callable[..., Distance]:
    return _line


@pytest.fixture(scope="session")
def circle() -> Callable[..., Distance]:
    return _circle


@pytest.fixture(scope="session")
def light() -> Callable[..., NDArray[np.float64]]:
    return _light


@pytest.fixture(scope="session")
def frame() -> Callable[..., NDArray[np.uint8]]:
    return _frame
