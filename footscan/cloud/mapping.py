"""Stripe points of one camera to world points."""

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.maps import is_supported, to_world
from footscan.cloud.points import make_points
from footscan.stripe.points import StripePoints
from schemas.calibration import CameraCalibration
from schemas.errors import RefusedInput
from schemas.parameters.mapping import MappingParameters


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
    stripe : (N,) points of one camera; frame, i and j (px) are used
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
        supported=is_supported(camera, pixels, parameters.margin_px),
    )
