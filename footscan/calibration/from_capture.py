"""Calibration from a capture: the stripe over the reference object, seen by every camera, and nobody clicks.

Each camera's view of the object is recognised; all cameras together tell whether it stood where it should; then every
point of the stripe is to lie on the edge of the known cross-section that it belongs to, in all placements at once, and
the model of each camera is chosen by held-out error.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.agreement import pair_agreements
from footscan.calibration.edge_points import EdgePoints
from footscan.calibration.fit import UndeterminedError
from footscan.calibration.from_chart import calibrated
from footscan.calibration.homography import HomographyModel, image_frame
from footscan.calibration.placement import CameraFit, departure, fit_to_edges, joined_poses
from footscan.calibration.recognition import FirstMap, UnrecognisedError, recognise
from footscan.calibration.reference import Edges
from footscan.calibration.selection import ModelTrial, asked_for, candidates, select
from schemas.calibration import Calibration, CameraCalibration, Source
from schemas.errors import RefusedInput
from schemas.mounting import Mounting
from schemas.parameters.calibration import CalibrationParameters

Floats = NDArray[np.float64]

SEEN = 0.5
"""A camera sees a placement where so much of its stripe is explained by the object."""
FEWEST_POINTS = 40
"""With fewer points of the stripe, all cameras together, a placement shows nothing."""
FOUND = 0.5
"""An object is where a departure says when so much of the stripe lies on its edges."""
LEVER_MM = 50.0
"""A turn moves the object's corners by this times its angle."""


@dataclass(frozen=True)
class CameraView:
    """What one camera saw of the reference object."""

    camera: int
    image_px: tuple[int, int]
    """Columns and rows."""
    stripes: Sequence[Floats]
    """For each of K placements the stripe's points (N, 2), px; empty where there are none."""
    mounting: Mounting


@dataclass(frozen=True)
class CalibratedView:
    """The calibration of one camera, and what it rests on."""

    calibration: CameraCalibration
    trials: list[ModelTrial]
    points: EdgePoints
    """What was used of the stripe."""


def recognise_view(view: CameraView, edges: Edges, placements: Floats) -> FirstMap | str:
    """The first map of a camera; or why there is none. `placements` is (K, 2), mm."""
    try:
        return recognise(view.stripes, edges, placements, view.mounting)
    except UnrecognisedError as reason:
        return str(reason)


def locate(
    views: Mapping[int, CameraView],
    first: Mapping[int, FirstMap | str],
    edges: Edges,
    placements: Floats,
    tolerance_mm: float,
    source: str,
) -> Floats:
    """Where the object stood, as all cameras together tell: (K, 3) mm, mm and radians.

    Raises
    ------
    RefusedInput
        A camera does not recognise the object, or it stood elsewhere than said by more than `tolerance_mm`.
    """
    maps = {camera: found for camera, found in first.items() if isinstance(found, FirstMap)}
    failed = {camera: found for camera, found in first.items() if isinstance(found, str)}
    poses = np.column_stack([placements, np.zeros(len(placements))])
    for number in range(len(placements)):
        if sum(len(view.stripes[number]) for view in views.values()) < FEWEST_POINTS:
            raise RefusedInput(source, "shows no stripe in any camera, expected the object", field=f"frame {number}")
    fits = {camera: _fit(views[camera], found, edges, poses) for camera, found in maps.items()}
    known = {camera: found for camera, found in fits.items() if found is not None}
    if len(placements) > 1 and known:
        _check_placements(views, {camera: maps[camera] for camera in known}, edges, poses, tolerance_mm, source)
    failed |= {camera: "too little of the stripe lies on the object" for camera in maps if camera not in known}
    if failed:
        camera = min(failed)
        others = f" (and so cameras {', '.join(map(str, sorted(failed)[1:]))})" if len(failed) > 1 else ""
        problem = f"the reference object is not recognised: {failed[camera]}{others}"
        raise RefusedInput(source, problem, field=f"camera {camera}")
    if len(placements) == 1:
        return poses
    return joined_poses(known, edges, poses)[0]


def calibrate_view(
    view: CameraView,
    first: FirstMap,
    edges: Edges,
    poses: Floats,
    parameters: CalibrationParameters,
    source: str,
) -> CalibratedView:
    """The calibration of one camera with the object in known `poses` (K, 3).

    Raises
    ------
    RefusedInput
        The model that was asked for cannot be fitted.
    """
    rough = _fit(view, first, edges, poses)
    assert rough is not None, "it was fitted when the object was located"
    points = rough.points
    observations = points.observations()
    tried = asked_for(candidates(observations.pixels, view.image_px), parameters)
    found, trials = select(tried, observations, view.camera, robust=True)
    if found is None:
        reason = trials[0].remark or "nothing can be held out"
        raise RefusedInput(source, f"no model can be judged: {reason}", field=f"camera {view.camera}")
    chosen = next(trial for trial in trials if trial.status == "chosen")
    return CalibratedView(calibrated(found, observations, chosen, view.image_px), trials, points)


def assemble(views: Sequence[CalibratedView], sources: list[Source], software: str) -> Calibration:
    """One calibration of all cameras, with how well each two of them agree."""
    cameras = {view.calibration.camera: view.calibration for view in views}
    return Calibration(
        sources=sources,
        software=software,
        cameras=[cameras[camera] for camera in sorted(cameras)],
        pairs=pair_agreements(cameras, {view.calibration.camera: view.points for view in views}),
    )


def _fit(view: CameraView, first: FirstMap, edges: Edges, poses: Floats) -> CameraFit | None:
    """The map that knows the lens, from placements in which the camera sees the object."""
    seen = [
        stripe if share >= SEEN else np.empty((0, 2))
        for stripe, share in zip(view.stripes, first.explained, strict=True)
    ]
    try:
        return fit_to_edges(seen, first.world, edges, poses, _lens(view))
    except UndeterminedError:
        return None


def _lens(view: CameraView) -> HomographyModel:
    return HomographyModel(*image_frame(view.image_px), distorted=True)


def _check_placements(
    views: Mapping[int, CameraView],
    maps: Mapping[int, FirstMap],
    edges: Edges,
    poses: Floats,
    tolerance_mm: float,
    source: str,
) -> None:
    """Refuses the placement in which the object stood farthest from where it was said, by maps that do not rest on it.

    Only cameras that recognise the object in most placements have a say.
    """
    trusted = [camera for camera, found in maps.items() if np.nanmean(found.explained >= SEEN) > 0.5] or list(maps)
    worst: tuple[float, str, str] | None = None
    for number in range(len(poses)):
        worlds = []
        for camera in trusted:
            view, explained = views[camera], maps[camera].explained.copy()
            explained[number] = 0.0
            fitted = _fit(view, replace(maps[camera], explained=explained), edges, poses)
            if fitted is not None:
                worlds.append(fitted.world(view.stripes[number]))
        if not worlds:
            continue
        found = departure(worlds, edges, poses[number])
        if found.share < FOUND:
            problem, size = "the reference object is not recognised where it should stand, nor near to it", np.inf
        else:
            size = max(float(np.hypot(*found.pose[:2])), float(abs(found.pose[2])) * LEVER_MM)
            stood, said = poses[number] + found.pose, poses[number]
            problem = (
                f"the object stood at ({stood[0]:.1f}, {stood[1]:.1f}) mm, turned by {np.degrees(stood[2]):.1f} "
                f"degrees, expected ({said[0]:g}, {said[1]:g}) as placements_mm says"
            )
        if size > tolerance_mm and (worst is None or size > worst[0]):
            worst = (size, problem, f"frame {number}")
    if worst is not None:
        raise RefusedInput(source, worst[1], field=worst[2])
