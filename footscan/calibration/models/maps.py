"""What a calibrated camera says: pixels to Y and Z in mm, back, and how sure it is."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from footscan.calibration.models.homography import HomographyModel
from footscan.calibration.models.polynomial import PolynomialModel
from footscan.calibration.models.region import supported
from schemas.calibration import CameraCalibration, HomographyMap, PolynomialMap

Floats = NDArray[np.float64]
Model = PolynomialModel | HomographyModel

IMAGE_PX = (640, 480)
"""Columns and rows of what the scanner's cameras film, where nothing says it."""
STARTS = 12
"""Newton's method begins at the nearest of so many places a side in the region."""
STEPS = 30
CONVERGED_PX = 1e-6
SINGULAR = 1e-12
"""mm^2/px^2: a map that takes a pixel to so small an area cannot be turned round there."""


def to_world(camera: CameraCalibration, pixels: NDArray[np.floating]) -> Floats:
    """Y and Z of pixels.

    Parameters
    ----------
    pixels : (N, 2), px, image frame: column i and row j.

    Returns
    -------
    (N, 2) float64, mm, scanner frame: Y and Z. What lies outside of the camera's region is extrapolated; see
    `is_supported`.
    """
    model, parameters = model_of(camera.map)
    return model.world(parameters, np.asarray(pixels, np.float64))


def to_pixels(camera: CameraCalibration, world: NDArray[np.floating]) -> Floats:
    """The pixels at which the camera sees points of the laser's plane.

    Parameters
    ----------
    world : (N, 2), mm, scanner frame: Y and Z.

    Returns
    -------
    (N, 2) float64, px, image frame; NaN where there is none to be found. Newton's method on `to_world`, from the
    nearest of a grid of pixels over the camera's region.
    """
    model, parameters = model_of(camera.map)
    world = np.asarray(world, np.float64)
    pixels = np.full(world.shape, np.nan)
    finite = np.isfinite(world).all(axis=1)
    pixels[finite] = _newton(model, parameters, world[finite], _grid(camera))
    return pixels


def prediction_covariance(camera: CameraCalibration, pixels: NDArray[np.floating]) -> Floats | None:
    """How sure `to_world` is because of what the map was fitted to: covariance (N, 2, 2) of Y and Z, mm^2.

    None where the calibration does not say. It tells of chance, not of a model that is too stiff.
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
    """Which of `pixels` (N, 2) lie where data support the camera's map, or at most `margin_px` beside it: (N,)."""
    return supported(camera.region_px, pixels, margin_px)


def model_of(pixel_map: PolynomialMap | HomographyMap) -> tuple[Model, Floats]:
    """The model behind a map, and its parameters (P,) in the order of the map's covariance."""
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
    """The pixels (N, 2) of finite `world` (N, 2), each sought from that of `starts` (M, 2) which maps nearest to it."""
    pixels = starts[cKDTree(model.world(parameters, starts)).query(world)[1]]
    step = np.zeros_like(pixels)
    longest = np.abs(starts).max() + 100.0
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


def _grid(camera: CameraCalibration) -> Floats:
    if camera.region_px:
        low, high = np.min(camera.region_px, axis=0), np.max(camera.region_px, axis=0)
    else:
        low, high = np.zeros(2), np.array(camera.image_px or IMAGE_PX) - 1.0
    i, j = np.meshgrid(*(np.linspace(low[k], high[k], STARTS) for k in (0, 1)))
    return np.column_stack([i.ravel(), j.ravel()])
