"""Uncertainty of the map and residuals of the fit of each camera, for the pictures of a calibration."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.maps import is_supported, model_of, prediction_covariance
from schemas.calibration import CameraCalibration

Floats = NDArray[np.float64]

GRID_PX = 4
"""Spacing of the pixels at which the uncertainty of the map is drawn."""
SHARE = 0.95
"""Quantile of residuals and uncertainties at which the scales of arrows and colours end; chosen by hand."""
LONG_PX = 30.0
"""Length in the image of an arrow whose residual has the length `arrow_unit_mm`."""


def round_up(value: float) -> float:
    """The least of 1, 2 and 5 times a power of ten that is not below `value`; 0.001 at least.

    >>> round_up(0.03)
    0.05
    """
    power = 10.0 ** np.floor(np.log10(max(value, 1e-3)))
    return float(next(factor * power for factor in (1, 2, 5, 10) if factor * power >= value * (1 - 1e-9)))


def arrow_unit_mm(cameras: Sequence[CameraCalibration]) -> float:
    """Length of the residual, mm, whose arrow is `LONG_PX` long: the quantile `SHARE` of all residuals, rounded up."""
    lengths = [np.hypot(*residuals_of(camera)[:, 2:].T) for camera in cameras]
    all_lengths = np.concatenate([np.empty(0), *lengths])
    return round_up(float(np.quantile(all_lengths, SHARE))) if all_lengths.size else 1.0


def figures_of(camera: CameraCalibration) -> str:
    """The residuals of a camera in words; without residuals, the number of its fitted points."""
    residuals = [("rms", camera.rms_mm), ("held out", camera.held_out_rms_mm), ("worst", camera.worst_mm)]
    figures = ", ".join(f"{name} {mm:.3f}" for name, mm in residuals if mm is not None)
    return f"{figures} mm" if figures else f"{camera.points} points"


def deviation_of(camera: CameraCalibration, grid_px: int = GRID_PX) -> Floats | None:
    """Standard deviation, mm, of (Y, Z) on a grid of the image, (rows, columns); None if it is unknown.

    It is NaN outside the region that data support. The grid has a spacing of `grid_px`.
    """
    rows, columns = camera.image_size
    i, j = np.meshgrid(np.arange(0, columns, grid_px), np.arange(0, rows, grid_px))
    pixels = np.column_stack([i.ravel(), j.ravel()]).astype(np.float64)
    inside = is_supported(camera, pixels) & bool(camera.region_px)
    covariance = prediction_covariance(camera, pixels[inside])
    if covariance is None:
        return None
    sigma = np.full(len(pixels), np.nan)
    sigma[inside] = np.sqrt(np.maximum(np.trace(covariance, axis1=1, axis2=2), 0.0))
    return sigma.reshape(i.shape)


def residuals_of(camera: CameraCalibration) -> Floats:
    """Residuals of a camera, (N, 4): i and j, px, and the errors in Y and Z, mm."""
    return np.array(camera.residuals, np.float64).reshape(-1, 4)


def arrows_of(camera: CameraCalibration, residuals: Floats) -> Floats:
    """Residuals as vectors (N, 2) that point as in the image, each as long as the residual in mm."""
    model, parameters = model_of(camera.map)
    errors = residuals[:, 2:]
    slopes = model.by_pixels(parameters, residuals[:, :2])
    seen = (np.linalg.pinv(slopes) @ errors[:, :, np.newaxis])[:, :, 0]
    length = np.hypot(*seen.T)
    return np.asarray(seen * (np.hypot(*errors.T) / np.where(length > 0, length, 1.0))[:, np.newaxis])
