"""Stripe points of one camera to world points."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.laser_plane import row_share, x_in_plane
from footscan.calibration.models.maps import is_supported, to_world
from footscan.calibration.models.uncertainty import predicted_deviations, standard_deviations
from footscan.cloud.points import make_points
from footscan.stripe.points import StripePoints
from schemas.base.errors import RefusedInput
from schemas.base.image_size import ImageSize
from schemas.calibration import CameraCalibration
from schemas.parameters.mapping import MappingParameters

Mask = NDArray[np.bool_]


def map_stripe(
    stripe: StripePoints,
    camera: CameraCalibration,
    x_of_frame: NDArray[np.float64],
    parameters: MappingParameters,
) -> NDArray[np.void]:
    """Map stripe points to world points.

    Y and Z follow from the pixel by the camera's calibration, X from the position of the head and, if the calibration
    says it, from the place and the turn of its laser plane. A camera that sees two lasers is mapped by both of its
    maps; `lasers.choose` then finds out in which plane each point lies.

    Parameters
    ----------
    stripe : (N,) points of one camera, in their order along the stripe; frame, i, j, width and sigma (px) are used
    x_of_frame : (F,) float64, X of the head in each frame, mm, scanner frame

    Returns
    -------
    (N,) of `POINT_DTYPE`, mm, scanner frame, in the order of `stripe`. Points without support by the calibration are
    marked, not left out.

    Raises
    ------
    RefusedInput
        The frame of a stripe point has no X.

    Examples
    --------
    A camera whose map is 0.5 mm a px, with the origin at pixel (320, 240):

    >>> from footscan.stripe.points import STRIPE_DTYPE
    >>> from schemas.calibration import PolynomialMap
    >>> map_ = PolynomialMap(order=1, centre_px=(320, 240), scale_px=100, alpha_y=[0, 50, 0], alpha_z=[0, 0, -50])
    >>> camera = CameraCalibration(camera=1, map=map_, region_px=[], points=0)
    >>> stripe = np.zeros(1, STRIPE_DTYPE)
    >>> stripe["i"], stripe["j"], stripe["width"], stripe["sigma"] = 340.0, 200.0, 6.0, 0.1
    >>> point = map_stripe(stripe, camera, np.array([12.5]), MappingParameters())[0]
    >>> print(point["x"], point["y"], point["z"])
    12.5 10.0 20.0
    """
    frame = stripe["frame"]
    if frame.size and not 0 <= int(frame.min()) <= int(frame.max()) < len(x_of_frame):
        problem = f"stripe points in frames up to {int(frame.max())}, expected an X for each, found {len(x_of_frame)}"
        raise RefusedInput(f"camera {camera.camera}", problem, field="positions")
    pixels = np.column_stack([stripe["i"], stripe["j"]]).astype(np.float64)
    yz = to_world(camera, pixels)
    x = plane = x_of_frame[frame] + camera.ahead_mm
    if camera.plane is not None:
        step = np.gradient(x_of_frame)[frame] if len(x_of_frame) > 1 else np.zeros(len(frame))
        row = row_share(pixels[:, 1], camera.image_size)
        plane = x + camera.plane.offset_mm + camera.plane.scale * (x - camera.plane.x_mm)
        x = x_in_plane(camera.plane, x, yz, step, row)
    return make_points(
        np.column_stack([x, yz]),
        camera=camera.view,
        frame=frame,
        source=np.arange(len(pixels)),
        supported=_supported(camera, pixels, parameters),
        sigma=standard_deviations(stripe, camera),
        plane=plane,
    )


def refuse_other_size(camera: CameraCalibration, size: ImageSize, film: Path | str) -> None:
    """Refuse frames of another size than those of the calibration.

    Raises
    ------
    RefusedInput
        `film` is not of the size that the calibration of its camera is for.
    """
    if size != camera.image_size:
        expected = f"expected frames of {camera.image_size} pixels, the size in the camera's calibration"
        raise RefusedInput(film, f"{expected}, found {size}", field="frame size")


def _supported(camera: CameraCalibration, pixels: NDArray[np.float64], parameters: MappingParameters) -> Mask:
    """True for pixels (N,) at which data support the map, or its covariance predicts that it holds without them."""
    supported = is_supported(camera, pixels, parameters.margin_px)
    outside = np.flatnonzero(~supported)
    predicted = predicted_deviations(camera, pixels[outside])
    if predicted is not None:
        supported[outside] = predicted <= parameters.extrapolation_mm
    return supported
