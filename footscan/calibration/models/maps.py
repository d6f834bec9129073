"""Maps of a calibrated camera: pixels to Y and Z in mm and back, with their uncertainty."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from footscan.calibration.models.homography import HomographyModel
from footscan.calibration.models.polynomial import PolynomialModel
from footscan.calibration.models.region import supported
from schemas.calibration import CameraCalibration, HomographyMap, PolynomialMap

Floats = NDArray[np.float64]
Model = PolynomialModel | HomographyModel

STARTS = 12
"""Places a side of the region; Newton's method starts at the nearest. Chosen by hand."""
STEPS = 30
"""Newton steps at most: a bound of time."""
CONVERGED_PX = 1e-6
"""Largest last step of a converged pixel."""
SINGULAR = 1e-12
"""Area of a mapped pixel, mm^2/px^2, up to which a map has no inverse there: rounding."""
FARTHEST_STEP_PX = 100.0
"""A Newton step is limited to the extent of the image plus so much."""


def to_world(camera: CameraCalibration, pixels: NDArray[np.floating]) -> Floats:
    """Map pixels to Y and Z.

    Parameters
    ----------
    pixels : (N, 2), px, image frame: column i and row j.

    Returns
    -------
    (N, 2) float64, mm, scanner frame: Y and Z. Pixels outside the camera's region are extrapolated; see
    `is_supported`.

    Examples
    --------
    >>> map_ = PolynomialMap(order=1, centre_px=(320, 240), scale_px=100, alpha_y=[0, 50, 0], alpha_z=[0, 0, -50])
    >>> camera = CameraCalibration(camera=1, map=map_, region_px=[], points=0)
    >>> print(to_world(camera, np.array([[340.0, 200.0]])))
    [[10. 20.]]
    """
    model, parameters = model_of(camera.map)
    return model.world(parameters, np.asarray(pixels, np.float64))


def to_pixels(camera: CameraCalibration, world: NDArray[np.floating]) -> Floats:
    """Find the pixels at which the camera sees points of the laser plane.

    They are the solution of `to_world` by Newton's method, from the nearest of a grid of pixels over the camera's
    region.

    Parameters
    ----------
    world : (N, 2), mm, scanner frame: Y and Z.

    Returns
    -------
    (N, 2) float64, px, image frame; NaN where no solution is found.

    Examples
    --------
    >>> map_ = PolynomialMap(order=1, centre_px=(320, 240), scale_px=100, alpha_y=[0, 50, 0], alpha_z=[0, 0, -50])
    >>> camera = CameraCalibration(camera=1, map=map_, region_px=[], points=0)
    >>> print(to_pixels(camera, np.array([[10.0, 20.0]])).round(6))
    [[340. 200.]]
    """
    model, parameters = model_of(camera.map)
    world = np.asarray(world, np.float64)
    pixels = np.full(world.shape, np.nan)
    finite = np.isfinite(world).all(axis=1)
    pixels[finite] = _newton(model, parameters, world[finite], grid_over(camera, STARTS))
    return pixels


def prediction_covariance(camera: CameraCalibration, pixels: NDArray[np.floating]) -> Floats | None:
    """Predict the covariance (N, 2, 2) of Y and Z, mm^2, at `pixels` (N, 2), px; None if the calibration has none.

    It covers random errors of the data to which the map was fitted, not the error of a model that is too stiff.
    """
    if not camera.covariance:
        return None
    model, parameters = model_of(camera.map)
    size = len(camera.covariance)
    covariance = np.zeros((size, size))
    covariance[np.tril_indices(size)] = np.concatenate([np.asarray(row) for row in camera.covariance])
    covariance = covariance + np.tril(covariance, -1).T
    by_parameters = model.by_parameters(parameters, np.asarray(pixels, np.float64))
    return np.asarray(by_parameters @ covariance @ by_parameters.transpose(0, 2, 1))


def is_supported(camera: CameraCalibration, pixels: NDArray[np.floating], margin_px: float = 0.0) -> NDArray[np.bool_]:
    """Select the `pixels` (N, 2), px, in the region that data support, or at most `margin_px` outside; (N,) bool."""
    return supported(camera.region_px, pixels, margin_px)


def model_of(pixel_map: PolynomialMap | HomographyMap) -> tuple[Model, Floats]:
    """The model of a map, and its parameters (P,) in the order of the map's covariance."""
    if isinstance(pixel_map, PolynomialMap):
        polynomial = PolynomialModel(pixel_map.order, pixel_map.centre_px, pixel_map.scale_px)
        return polynomial, np.array(pixel_map.alpha_y + pixel_map.alpha_z)
    distortion, correction = pixel_map.distortion, pixel_map.correction
    homography = HomographyModel(
        pixel_map.centre_px, pixel_map.scale_px, distortion is not None, correction.order if correction else None
    )
    parameters = list(pixel_map.matrix)
    if distortion is not None:
        parameters += [distortion.k1, distortion.k2, distortion.p1, distortion.p2]
    if correction is not None:
        parameters += correction.alpha_y + correction.alpha_z
    return homography, np.array(parameters)


def _newton(model: Model, parameters: Floats, world: Floats, starts: Floats) -> Floats:
    """The pixels (N, 2) of finite `world` (N, 2), each from the pixel of `starts` (M, 2) that maps nearest to it."""
    pixels = starts[cKDTree(model.world(parameters, starts)).query(world)[1]]
    step = np.zeros_like(pixels)
    longest = np.abs(starts).max() + FARTHEST_STEP_PX
    for _ in range(STEPS):
        slope = model.by_pixels(parameters, pixels)
        regular = np.abs(slope[:, 0, 0] * slope[:, 1, 1] - slope[:, 0, 1] * slope[:, 1, 0]) > SINGULAR
        slope[~regular] = np.eye(2)
        missing = world - model.world(parameters, pixels)
        step = np.linalg.solve(slope, missing[:, :, np.newaxis])[:, :, 0]
        step[~regular] = np.nan
        pixels = pixels + np.clip(step, -longest, longest)
        if not np.any(np.abs(step) > CONVERGED_PX):
            break
    return np.where((np.abs(step) <= CONVERGED_PX).all(axis=1, keepdims=True), pixels, np.nan)


def grid_over(camera: CameraCalibration, count: int) -> Floats:
    """(count^2, 2) pixels over the camera's region, or over its image."""
    low, high = np.zeros(2), np.array(camera.image_size.px) - 1.0
    if camera.region_px:
        low, high = np.min(camera.region_px, axis=0), np.max(camera.region_px, axis=0)
    i, j = np.meshgrid(*(np.linspace(low[k], high[k], count) for k in (0, 1)))
    return np.column_stack([i.ravel(), j.ravel()])
