"""A calibration with the laser planes that a film of a body shows."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.laser_plane import row_share
from footscan.calibration.models.maps import is_supported, to_world
from footscan.calibration.models.pose import camera_centres
from footscan.calibration.models.uncertainty import standard_deviations
from footscan.calibration.travel.body import Body
from footscan.calibration.travel.fit import OF_CAMERA, OF_HEAD, TravelFit, TravelPoints, fit_travel
from footscan.stripe.points import StripePoints
from schemas.base.errors import Finding
from schemas.calibration import Calibration, CameraCalibration, LaserPlane

Floats = NDArray[np.float64]

DELAY = len(OF_HEAD) + OF_CAMERA.index("delay_frames")
"""Column of the delays in the planes of a fit."""
FEWEST = 500
"""Points of a camera on the body, at least. Chosen by hand."""
LARGEST_DELAY = 0.4
"""Difference of the delays of two cameras of a head, in frames, from which a film is refused. Latencies that were
measured differ by hundredths of a frame; a camera that lost a frame unnoticed is one off. Chosen by hand."""
LARGEST_RMS_MM = 0.1
"""Distance of the points from the body from which a warning is given: the body is another one, its form is off, or the
cameras' maps are. Chosen by hand."""


class CameraTravel(NamedTuple):
    """The film of one camera."""

    stripe: StripePoints
    """(N,) its stripe points"""
    x_of_frame: Floats
    """(F,) X of its head by the travel, mm"""


def with_laser_planes(
    calibration: Calibration, films: Mapping[int, CameraTravel], head_of_camera: Mapping[int, int], body: Body
) -> tuple[Calibration, TravelFit]:
    """Find where the laser planes lie, from the film of a body.

    Parameters
    ----------
    calibration : with the maps of the cameras
    films : view, as numbered by `schemas.calibration.view_number`, -> its film: of a camera that sees two lasers, two
        films with the stripe points of each
    head_of_camera : camera -> number of its head; each laser of a head has a plane of its own

    Returns
    -------
    The calibration with the planes of the cameras that filmed the body, and the fit.

    Raises
    ------
    Finding
        A camera hardly saw the body, the points do not lie on it, or a camera was a frame off the others of its head.
    """
    cameras = sorted(films)
    calibrated = {camera.view: camera for camera in calibration.cameras}
    maps = {view: calibrated[view].model_copy(update={"plane": None}) for view in cameras}
    sheets = {view: (head_of_camera[camera.camera], camera.laser) for view, camera in maps.items()}
    numbers = sorted(set(sheets.values()))
    centres = camera_centres(maps.values())
    parts = []
    for index, camera in enumerate(cameras):
        part = _points(index, maps[camera], films[camera], centres.get(camera, np.full(3, np.nan)))
        if len(part.x) < FEWEST:
            raise Finding(f"camera {maps[camera].name} saw {len(part.x)} points of the body, expected {FEWEST}")
        parts.append(part)
    points = TravelPoints(*(np.concatenate(fields) for fields in zip(*parts, strict=True)))
    fit = fit_travel(points, [numbers.index(sheets[view]) for view in cameras], body)
    _refuse_lost_frames(fit.planes[:, DELAY], [maps[view] for view in cameras], head_of_camera)
    planes = {camera: _plane(fit, index, sheets[camera][0]) for index, camera in enumerate(cameras)}
    warnings = [*calibration.warnings]
    if fit.rms_mm > LARGEST_RMS_MM:
        warnings.append(
            f"the points lie {fit.rms_mm:.2f} mm off the body that shows the laser planes, expected "
            f"{LARGEST_RMS_MM:g} mm: its form is not that of the file, or the maps of the cameras are off"
        )
    document = calibration.model_copy(
        update={
            "cameras": [camera.model_copy(update={"plane": planes.get(camera.view)}) for camera in calibration.cameras],
            "body_rms_mm": round(fit.rms_mm, 5),
            "warnings": warnings,
        }
    )
    return document, fit


def _refuse_lost_frames(
    delays: Floats, cameras: Sequence[CameraCalibration], head_of_camera: Mapping[int, int]
) -> None:
    """Refuse delays (C,), in frames, by which cameras of one head contradict each other.

    The delays of a head's cameras count from their mean, so that one frame that one camera lost would move the plane.
    """
    heads = np.array([head_of_camera[camera.camera] for camera in cameras])
    for head in np.unique(heads):
        of_head = np.flatnonzero(heads == head)
        off = delays[of_head] - np.median(delays[of_head])
        worst = int(np.argmax(np.abs(off)))
        if np.ptp(off) > LARGEST_DELAY:
            raise Finding(
                f"camera {cameras[of_head[worst]].name} was {np.ptp(off):.1f} frames off the other cameras of its head "
                f"while the body was filmed, expected {LARGEST_DELAY:g} at most: film the body again, or measure the "
                "latencies of the cameras first"
            )


def _points(index: int, camera: CameraCalibration, film: CameraTravel, centre: Floats) -> TravelPoints:
    """The points of one camera within its region of support."""
    pixels = np.column_stack([film.stripe["i"], film.stripe["j"]]).astype(np.float64)
    supported = is_supported(camera, pixels)
    stripe, pixels = film.stripe[supported], pixels[supported]
    yz = to_world(camera, pixels)
    sight = centre - np.column_stack([np.zeros(len(yz)), yz])
    return TravelPoints(
        np.full(len(yz), index),
        film.x_of_frame[stripe["frame"]] + camera.ahead_mm,
        np.gradient(film.x_of_frame)[stripe["frame"]],
        row_share(pixels[:, 1], camera.image_size),
        yz,
        sight,
        standard_deviations(stripe, camera),
    )


def _plane(fit: TravelFit, index: int, head: int) -> LaserPlane:
    offset, yaw, pitch, bend, scale, delay, shutter = (float(value) for value in fit.planes[index])
    return LaserPlane(
        head=head,
        offset_mm=offset,
        yaw=yaw,
        pitch=pitch,
        bend_mm=bend,
        scale=scale,
        x_mm=fit.x_mm,
        delay_frames=delay,
        shutter_frames=shutter,
        sd=[float(value) for value in fit.deviations[index]],
    )
