"""Where the object stood in one placement, by maps that were fitted without it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.from_capture import SEEN, CameraView, Recognised, fit_view
from footscan.calibration.capture.placement import CameraFit, Departure, departure
from footscan.calibration.capture.reference import Edges
from footscan.calibration.models.fit import UndeterminedError
from schemas.calibration import view_name

Floats = NDArray[np.float64]

LEAST_SHARE = 0.5
"""Share of the stripe on the object's edges from which its departure is known. Chosen by hand."""
SURE_MM = 0.25
"""Standard deviation of a map, fitted without a placement, up to which its camera judges the placement. Chosen by
hand."""
SIGMAS = 3.0
"""Standard deviations of the best map that are added to the tolerance of a departure."""
MOSTLY = 0.5
"""Share of the placements in which a camera must recognise the object to be trusted."""


@dataclass(frozen=True)
class JudgedPlacement:
    """A placement in the eyes of the cameras that are sure of it."""

    maps: dict[int, CameraFit]
    """The map of each of these cameras, fitted without the placement."""
    change: Departure
    margin_mm: float
    """How much more than the tolerance a departure may be, since the maps are not exact."""


def judge_placement(
    number: int, views: Mapping[int, CameraView], recognised: Mapping[int, Recognised], edges: Edges, poses: Floats
) -> JudgedPlacement | None:
    """Measure the departure of the object in placement `number` of the nominal `poses` (K, 3), mm, mm, radians.

    None if no camera's map is sure there.
    """
    maps = _maps_without(number, recognised, edges, poses)
    return judge_by(maps, {camera: views[camera].stripes[number] for camera in maps}, edges, poses[number])


def judge_by(
    maps: Mapping[int, CameraFit], stripes: Mapping[int, Floats], edges: Edges, pose: Floats
) -> JudgedPlacement | None:
    """Measure the departure of the object from a nominal `pose` (3,) by maps that were fitted without its `stripes`."""
    all_sigmas = {camera: map_.fit.region_sigma(stripes[camera]) for camera, map_ in maps.items()}
    sigmas = {camera: sigma for camera, sigma in all_sigmas.items() if sigma is not None and sigma <= SURE_MM}
    sure = {camera: maps[camera] for camera in sigmas}
    if not sure:
        return None
    worlds = [map_.world(stripes[camera]) for camera, map_ in sure.items()]
    return JudgedPlacement(sure, departure(worlds, edges, pose), SIGMAS * min(sigmas.values()))


def in_words(cameras: Iterable[int]) -> str:
    """The cameras, or views of cameras, in words.

    >>> in_words([3]), in_words([3, 1])
    ('camera 3', 'cameras 1, 3')
    """
    listed = ", ".join(map(view_name, sorted(cameras)))
    return f"cameras {listed}" if "," in listed else f"camera {listed}"


def _maps_without(
    number: int, recognised: Mapping[int, Recognised], edges: Edges, poses: Floats
) -> dict[int, CameraFit]:
    """The maps of all trusted cameras, fitted without one of the placements."""
    trusted = {c: result for c, result in recognised.items() if np.nanmean(result.first.explained >= SEEN) > MOSTLY}
    maps = {}
    for camera, result in (trusted or recognised).items():
        try:
            maps[camera] = fit_view(result.view, result.first, edges, poses, without=number)
        except UndeterminedError:
            continue
    return maps
