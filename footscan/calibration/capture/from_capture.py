"""Calibration from a capture: the stripe over the reference object, seen by all cameras, without any clicks.

The object is recognised in the view of each camera. All cameras together determine its poses. Then a map is fitted that
brings each point of the stripe onto its edge of the known cross-section, in all placements at once. The model of each
camera is selected by held-out error.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.agreement import pair_agreements
from footscan.calibration.capture.edge_points import EdgePoints
from footscan.calibration.capture.found_corners import FoundCorner, corners_in
from footscan.calibration.capture.placement import CameraFit, fit_to_edges, joined_poses
from footscan.calibration.capture.recognition import FirstMap, UnrecognisedError, recognise
from footscan.calibration.capture.reference import Edges
from footscan.calibration.chart.from_chart import calibrated
from footscan.calibration.models.fit import UndeterminedError
from footscan.calibration.models.homography import HomographyModel, image_frame
from footscan.calibration.models.selection import ModelTrial, candidates, requested_models, select
from schemas.base.errors import RefusedInput
from schemas.calibration import Calibration, CameraCalibration, Source, view_name
from schemas.mounting import Mounting
from schemas.parameters.calibration import CalibrationParameters

Floats = NDArray[np.float64]

STRIPE = 100
"""Points from which a frame shows a stripe, on whatever object. Chosen by hand."""
SEEN = 0.5
"""Share of the stripe explained by the object from which a camera sees a placement. Chosen by hand."""


@dataclass(frozen=True)
class CameraView:
    """The stripe of one camera over the reference object."""

    camera: int
    """Number of the camera, or of its view of a second laser as in `schemas.calibration.view_number`."""
    image_px: tuple[int, int]
    """Columns and rows."""
    stripes: Sequence[Floats]
    """For each of K placements the points (N, 2) of the stripe, px, N >= 0."""
    mounting: Mounting
    lost: tuple[int, ...] = ()
    """Frames that cannot be decoded."""


@dataclass(frozen=True)
class Recognised:
    """A view in which the object is recognised."""

    view: CameraView
    first: FirstMap
    rough: CameraFit
    """A map with distortion, for the object in its nominal poses."""

    @property
    def doubts(self) -> list[str]:
        """Possible mistakes in the capture, a line each."""
        camera = f"camera {view_name(self.view.camera)}"
        doubts = [f"{camera}: frame {number} cannot be decoded and is not used" for number in self.view.lost]
        doubts += [
            f"{camera}: the object is not recognised in frame {number}, which is not used"
            for number, (stripe, share) in enumerate(zip(self.view.stripes, self.first.explained, strict=True))
            if len(stripe) >= STRIPE and share < SEEN
        ]
        if self.contradiction:
            doubts.append(f"{camera} {self.contradiction}")
        return doubts

    @property
    def contradiction(self) -> str | None:
        """The contradiction between view and mounting: the film may be another camera's, or the placements wrong."""
        nominal, seen = self.view.mounting, self.first.seen_from
        return f"sees the object from {seen}, expected from {nominal}" if seen.contradicts(nominal) else None


@dataclass(frozen=True)
class CalibratedView:
    """The calibration of one camera, with its data."""

    calibration: CameraCalibration
    trials: list[ModelTrial]
    points: EdgePoints
    """The points of the stripe that were used."""
    corners: list[FoundCorner]


def recognise_view(view: CameraView, edges: Edges, placements: Floats) -> Recognised | str:
    """Recognise the object in the view of a camera, in its `placements` (K, 2), mm; or give the reason why not."""
    try:
        first = recognise(view.stripes, edges, placements, view.mounting)
    except UnrecognisedError as reason:
        return str(reason)
    try:
        return Recognised(view, first, fit_view(view, first, edges, nominal_poses(placements)))
    except UndeterminedError:
        return "too little of the stripe lies on the object"


def fit_view(view: CameraView, first: FirstMap, edges: Edges, poses: Floats, without: int | None = None) -> CameraFit:
    """Fit a map with distortion to the placements in which a camera sees the object, one of which may be left out.

    Parameters
    ----------
    poses : (K, 3) of the object, mm, mm and radians.
    without : number of the placement to leave out.

    Raises
    ------
    UndeterminedError
        Too little of the stripe lies on the object.
    """
    seen = [
        stripe if share >= SEEN and number != without else np.empty((0, 2))
        for number, (stripe, share) in enumerate(zip(view.stripes, first.explained, strict=True))
    ]
    lens = HomographyModel(*image_frame(view.image_px), distorted=True)
    return fit_to_edges(seen, first.world, edges, poses, lens)


def nominal_poses(placements: Floats) -> Floats:
    """Convert the `placements` (K, 2), mm, of an object to poses (K, 3), mm, mm and radians, without rotation.

    >>> print(nominal_poses(np.array([[10.0, 0.0]])))
    [[10.  0.  0.]]
    """
    return np.column_stack([placements, np.zeros(len(placements))])


def object_poses(recognised: Mapping[int, Recognised], edges: Edges, placements: Floats) -> Floats:
    """Determine the poses (K, 3) of the object, mm, mm and radians, from all cameras; a single placement is kept."""
    poses = nominal_poses(placements)
    if len(placements) == 1:
        return poses
    return joined_poses({camera: result.rough for camera, result in recognised.items()}, edges, poses)[0]


def calibrate_view(
    recognised: Recognised, edges: Edges, poses: Floats, parameters: CalibrationParameters, source: str
) -> CalibratedView:
    """Calibrate one camera with the object in known `poses` (K, 3), mm, mm and radians.

    Raises
    ------
    RefusedInput
        No requested model can be fitted.
    """
    view = recognised.view
    points = fit_view(view, recognised.first, edges, poses).points
    observations = points.observations()
    tried = requested_models(candidates(observations.pixels, view.image_px), parameters)
    fitted, trials = select(tried, observations, view.camera, robust=True)
    if fitted is None:
        reason = trials[0].remark or "no data can be held out"
        raise RefusedInput(source, f"no model can be judged: {reason}", field=f"camera {view_name(view.camera)}")
    chosen = next(trial for trial in trials if trial.status == "chosen")
    calibration = calibrated(fitted, observations, chosen, view.image_px)
    return CalibratedView(calibration, trials, points, list(corners_in(calibration, view.stripes, edges, poses)))


def assemble(views: Sequence[CalibratedView], sources: list[Source], software: str, warnings: list[str]) -> Calibration:
    """Assemble the calibration of all cameras, with the agreement of each pair of them."""
    cameras = {view.calibration.view: view.calibration for view in views}
    return Calibration(
        sources=sources,
        software=software,
        warnings=warnings,
        cameras=[cameras[camera] for camera in sorted(cameras)],
        pairs=pair_agreements(cameras, {view.calibration.view: view.points for view in views}),
    )
