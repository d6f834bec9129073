"""How far off a world point is to be expected, from its stripe point and its camera's calibration."""

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.maps import model_of, prediction_covariance
from footscan.stripe.points import StripePoints
from schemas.calibration import CameraCalibration

Floats = NDArray[np.float64]

REACH = 3
"""The stripe runs from so many points before a point to so many after it."""
GAP_PX = 5.0
"""Points of one piece of the stripe are no farther apart."""
END_ERROR = 0.13
"""Where a stripe ends, at an edge or in a shadow, only a part of its width is seen, and its centre is off by so many
widths; the error halves"""
END_REACH = 0.8
"""at so many widths from there. Measured on virtual feet."""
EVERY = 8
"""A calibration's covariance changes slowly: that of every eighth point serves those behind it."""
SHORTEST_MM = 1e-9
"""Per px; a map that is singular somewhere is of no use there, but still a number."""


def standard_deviations(stripe: StripePoints, camera: CameraCalibration) -> Floats:
    """(N,) standard deviations of the world points of `stripe`, mm, along the normal of the surface in the laser plane.

    Three parts are added in squares. The stripe's `sigma`, and what it is off near the ends of its pieces, are in px
    across it: a stripe along the unit vector t of the image runs along J t in the world, J being the derivatives of the
    map, and one px across it there is |det J| / |J t|. What the calibration's covariance predicts knows of chance
    alone, and is too little where the map is too stiff for its camera; it is taken to be no less than what the map left
    on held-out data.

    Parameters
    ----------
    stripe : (N,) points of one camera, in their order along the stripe; frame, i, j, width and sigma (px) are used
    """
    pixels = np.column_stack([stripe["i"], stripe["j"]]).astype(np.float64)
    directions, to_end = _along(stripe["frame"], pixels)
    width = stripe["width"].astype(np.float64)
    of_end = END_ERROR * width / (1.0 + to_end / (END_REACH * np.maximum(width, 1.0)))
    across = np.hypot(stripe["sigma"].astype(np.float64), of_end)

    model, parameters = model_of(camera.map)
    slope = model.by_pixels(parameters, pixels)
    along = np.einsum("nkl,nl->nk", slope, directions)
    length = np.maximum(np.hypot(along[:, 0], along[:, 1]), SHORTEST_MM)
    area = np.abs(slope[:, 0, 0] * slope[:, 1, 1] - slope[:, 0, 1] * slope[:, 1, 0])

    left = camera.held_out_rms_mm if camera.held_out_rms_mm is not None else camera.rms_mm
    of_calibration = np.full(len(pixels), (left or 0.0) ** 2)
    covariance = _covariances(camera, pixels)
    if covariance is not None:
        normal = np.column_stack([-along[:, 1], along[:, 0]]) / length[:, np.newaxis]
        of_calibration = np.maximum(of_calibration, np.einsum("nk,nkl,nl->n", normal, covariance, normal))
    return np.asarray(np.sqrt((across * area / length) ** 2 + of_calibration))


def predicted_deviations(camera: CameraCalibration, pixels: Floats) -> Floats | None:
    """(N,) standard deviation in mm that the calibration's covariance predicts at (N, 2) `pixels`, in its worst
    direction; None where it has no covariance."""
    covariance = _covariances(camera, pixels)
    return None if covariance is None else np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[:, -1], 0.0))


def _covariances(camera: CameraCalibration, pixels: Floats) -> Floats | None:
    covariance = prediction_covariance(camera, pixels[::EVERY])
    return None if covariance is None else np.repeat(covariance, EVERY, axis=0)[: len(pixels)]


def _along(frame: NDArray[np.integer], pixels: Floats) -> tuple[Floats, Floats]:
    """(N, 2) unit vectors along the stripe at its points (N, 2), and (N,) how far the next end of a piece is, px."""
    count = len(pixels)
    if count < 2:
        return np.tile([1.0, 0.0], (count, 1)), np.zeros(count)
    steps = np.diff(pixels, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    joined = (np.diff(frame) == 0) & (lengths <= GAP_PX)
    piece = np.concatenate([[0], np.cumsum(~joined)])
    first = np.searchsorted(piece, piece, side="left")
    last = np.searchsorted(piece, piece, side="right") - 1
    number = np.arange(count)
    along = pixels[np.minimum(number + REACH, last)] - pixels[np.maximum(number - REACH, first)]
    length = np.hypot(along[:, 0], along[:, 1])
    along[length == 0] = [1.0, 0.0]  # a point on its own
    place = np.concatenate([[0.0], np.cumsum(lengths)])
    to_end = np.minimum(place - place[first], place[last] - place)
    return np.asarray(along / np.where(length == 0, 1.0, length)[:, np.newaxis]), to_end
