"""Stripe points of one camera to world points."""

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.maps import is_supported, to_world
from footscan.cloud.points import make_points
from footscan.cloud.uncertainty import predicted_deviations, standard_deviations
from footscan.stripe.points import StripePoints
from schemas.base.errors import RefusedInput
from schemas.calibration import CameraCalibration
from schemas.parameters.mapping import MappingParameters

Mask = NDArray[np.bool_]


def map_stripe(
    stripe: StripePoints,
    camera: CameraCalibration,
    x_of_frame: NDArray[np.float64],
    parameters: MappingParameters,
) -> NDArray[np.void]:
    """The world point of every stripe point, in the same order.

    Y and Z follow from the pixel by the camera's calibration, X from where the head stood.

    Parameters
    ----------
    stripe : (N,) points of one camera, in their order along the stripe; frame, i, j, width and sigma (px) are used
    x_of_frame : (F,) X of the laser plane in each frame, mm

    Returns
    -------
    (N,) array of `POINT_DTYPE`, mm, scanner frame. Points without support by the calibration are marked, not left out.

    Raises
    ------
    RefusedInput
        A stripe point's frame has no X.
    """
    frame = stripe["frame"]
    if frame.size and not 0 <= int(frame.min()) <= int(frame.max()) < len(x_of_frame):
        problem = f"stripe points in frames up to {int(frame.max())}, expected an X for each, found {len(x_of_frame)}"
        raise RefusedInput(f"camera {camera.camera}", problem, field="positions")
    pixels = np.column_stack([stripe["i"], stripe["j"]]).astype(np.float64)
    yz = to_world(camera, pixels)
    return make_points(
        np.column_stack([x_of_frame[frame], yz]),
        camera=camera.camera,
        frame=frame,
        source=np.arange(len(pixels)),
        supported=_supported(camera, pixels, parameters),
        sigma=standard_deviations(stripe, camera),
    )


def _supported(camera: CameraCalibration, pixels: NDArray[np.float64], parameters: MappingParameters) -> Mask:
    """(N,) whether data support the map at a pixel, or its covariance tells that it holds there without them."""
    supported = is_supported(camera, pixels, parameters.margin_px)
    outside = np.flatnonzero(~supported)
    predicted = predicted_deviations(camera, pixels[outside])
    if predicted is not None:
        supported[outside] = predicted <= parameters.extrapolation_mm
    return supported
