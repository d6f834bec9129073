"""Polynomials of the pixel: their terms, their value, and the region of the image that supports them."""

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from schemas.calibration import PolynomialCamera


def terms(order: int) -> int:
    """How many terms a polynomial of two variables has.

    >>> [terms(order) for order in (1, 2, 3, 4, 5)]
    [3, 6, 10, 15, 21]
    """
    return (order + 1) * (order + 2) // 2


def design_matrix(u: ArrayLike, v: ArrayLike, order: int) -> NDArray[np.float64]:
    """The terms at (u, v), each of shape (N,): an (N, terms) matrix in the order 1, u, v, u^2, uv, v^2, u^3, ...

    >>> design_matrix([2.0], [3.0], 2)
    array([[1., 2., 3., 4., 6., 9.]])
    """
    u, v = np.asarray(u, np.float64), np.asarray(v, np.float64)
    powers = [(degree - k, k) for degree in range(order + 1) for k in range(degree + 1)]
    return np.stack([u**a * v**b for a, b in powers], axis=-1)


def evaluate(camera: PolynomialCamera, pixels: NDArray[np.floating]) -> NDArray[np.float64]:
    """Y and Z of pixels.

    Parameters
    ----------
    pixels : (N, 2), px, image frame: column i and row j.

    Returns
    -------
    (N, 2) float64, mm, scanner frame: Y and Z.
    """
    normalised = (np.asarray(pixels, np.float64) - np.array(camera.centre_px)) / camera.scale_px
    world: NDArray[np.float64] = _evaluate(normalised, camera.order, np.array([camera.alpha_y, camera.alpha_z]))
    return world


def supported(camera: PolynomialCamera, pixels: NDArray[np.floating], margin_px: float = 0.0) -> NDArray[np.bool_]:
    """Which pixels lie in the region that control points support, or at most `margin_px` beyond one of its sides.

    The region is convex. `pixels` is (N, 2), px, image frame; the result is (N,). A camera whose region is not known
    supports every pixel.
    """
    if not camera.region_px:
        return np.ones(len(pixels), np.bool_)
    corners = np.array(camera.region_px)
    sides = np.roll(corners, -1, axis=0) - corners
    sides, corners = sides[np.any(sides != 0, axis=1)], corners[np.any(sides != 0, axis=1)]
    doubled_area = np.sum(corners[:, 0] * np.roll(corners[:, 1], -1) - np.roll(corners[:, 0], -1) * corners[:, 1])
    # Inward unit normals: the corners may run either way round.
    inward = np.sign(doubled_area) * np.stack([-sides[:, 1], sides[:, 0]], axis=1)
    inward /= np.hypot(sides[:, 0], sides[:, 1])[:, np.newaxis]
    offsets = np.sum(inward * corners, axis=1)
    rounding = 1e-9 * (1.0 + np.abs(corners).max(initial=0.0))  # a corner lies in its own region
    inside: NDArray[np.bool_] = _inside(np.asarray(pixels, np.float64), inward, offsets - margin_px - rounding)
    return inside


@numba.njit(cache=True, nogil=True)
def _evaluate(uv: NDArray[np.float64], order: int, alpha: NDArray[np.float64]) -> NDArray[np.float64]:
    world = np.empty((uv.shape[0], 2))
    u_power = np.ones(order + 1)
    v_power = np.ones(order + 1)
    for n in range(uv.shape[0]):
        for k in range(1, order + 1):
            u_power[k] = u_power[k - 1] * uv[n, 0]
            v_power[k] = v_power[k - 1] * uv[n, 1]
        y = 0.0
        z = 0.0
        term = 0
        for degree in range(order + 1):
            for k in range(degree + 1):
                value = u_power[degree - k] * v_power[k]
                y += alpha[0, term] * value
                z += alpha[1, term] * value
                term += 1
        world[n, 0] = y
        world[n, 1] = z
    return world


@numba.njit(cache=True, nogil=True)
def _inside(
    pixels: NDArray[np.float64], inward: NDArray[np.float64], offsets: NDArray[np.float64]
) -> NDArray[np.bool_]:
    inside = np.ones(pixels.shape[0], np.bool_)
    for n in range(pixels.shape[0]):
        for k in range(offsets.shape[0]):
            # Written so that a pixel that is not a number lies outside.
            if not inward[k, 0] * pixels[n, 0] + inward[k, 1] * pixels[n, 1] >= offsets[k]:
                inside[n] = False
                break
    return inside
