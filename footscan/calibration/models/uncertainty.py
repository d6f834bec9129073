"""The uncertainty of a world point, from its stripe point and its camera's calibration."""

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.maps import model_of, prediction_covariance
from footscan.stripe.points import StripePoints
from schemas.calibration import CameraCalibration

Floats = NDArray[np.float64]

REACH = 3
"""Points before and after a point between which the direction of the stripe is taken. Chosen by hand."""
GAP_PX = 5.0
"""Largest distance of consecutive points of one piece of the stripe: the default of `gap_px` of the extraction."""
END_ERROR = 0.13
"""Error of the centre at the end of a stripe, in widths: at an edge or in a shadow only a part of the width is seen.
Measured on virtual feet."""
END_REACH = 0.8
"""Distance from the end, in widths, at which that error has halved. Measured on virtual feet."""
COVARIANCE_STEP = 8
"""Points that share one covariance of the calibration, which changes slowly: a bound of time."""
SHORTEST_MM = 1e-9
"""Least scale of a map, mm per px: the result stays finite where a map is singular."""


def standard_deviations(stripe: StripePoints, camera: CameraCalibration) -> Floats:
    """Estimate the standard deviations of the world points of one camera's stripe.

    Three variances are added. The stripe's `sigma`, and its error near the ends of its pieces, are in px across the
    stripe: with J the derivatives of the map, a stripe along the unit vector t of the image runs along J t in the
    world, and 1 px across it is |det J| / |J t| mm there. The third is that of the calibration. Its covariance covers
    random errors only, and is too small where the model is too stiff for the camera; the residual of the map on
    held-out data is therefore its lower bound.

    Parameters
    ----------
    stripe : (N,) points of one camera, in their order along the stripe; frame, i, j, width and sigma (px) are used

    Returns
    -------
    (N,) float64, mm, along the normal of the surface within the laser plane.

    Examples
    --------
    The middle of a stripe with sigma 0.1 px and a map of 0.5 mm a px:

    >>> from footscan.stripe.points import STRIPE_DTYPE
    >>> from schemas.calibration import PolynomialMap
    >>> map_ = PolynomialMap(order=1, centre_px=(320, 240), scale_px=100, alpha_y=[0, 50, 0], alpha_z=[0, 0, -50])
    >>> camera = CameraCalibration(camera=1, map=map_, region_px=[], points=0)
    >>> stripe = np.zeros(400, STRIPE_DTYPE)
    >>> stripe["i"], stripe["j"], stripe["width"], stripe["sigma"] = np.arange(400), 240.0, 6.0, 0.1
    >>> sigmas = standard_deviations(stripe, camera)
    >>> print(round(float(sigmas[200]), 2), bool(sigmas[0] > sigmas[200]))
    0.05 True
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

    residual_mm = camera.held_out_rms_mm if camera.held_out_rms_mm is not None else camera.rms_mm
    of_calibration = np.full(len(pixels), (residual_mm or 0.0) ** 2)
    covariance = _covariances(camera, pixels)
    if covariance is not None:
        normal = np.column_stack([-along[:, 1], along[:, 0]]) / length[:, np.newaxis]
        of_calibration = np.maximum(of_calibration, np.einsum("nk,nkl,nl->n", normal, covariance, normal))
    return np.asarray(np.sqrt((across * area / length) ** 2 + of_calibration))


def predicted_deviations(camera: CameraCalibration, pixels: Floats) -> Floats | None:
    """Predict the standard deviations of a map from the covariance of its calibration.

    Parameters
    ----------
    pixels : (N, 2) i and j, px.

    Returns
    -------
    (N,) float64, mm, in the worst direction of Y and Z; None if the calibration has no covariance.
    """
    covariance = _covariances(camera, pixels)
    return None if covariance is None else np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[:, -1], 0.0))


def _covariances(camera: CameraCalibration, pixels: Floats) -> Floats | None:
    """(N, 2, 2) covariances of Y and Z, mm^2, one for `COVARIANCE_STEP` pixels; None if the camera has none."""
    covariance = prediction_covariance(camera, pixels[::COVARIANCE_STEP])
    return None if covariance is None else np.repeat(covariance, COVARIANCE_STEP, axis=0)[: len(pixels)]


def _along(frame: NDArray[np.integer], pixels: Floats) -> tuple[Floats, Floats]:
    """(N, 2) unit vectors along the stripe at its points (N, 2), and (N,) distances to the nearer end, px."""
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
