"""Calibration from a capture: the stripe over the reference object, seen by every camera, and nobody clicks.

Each camera's view of the object is recognised; all cameras together tell whether it stood where it should; then every
point of the stripe is to lie on the edge of the known cross-section that it belongs to, in all placements at once, and
the model of each camera is chosen by held-out error.
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
from footscan.calibration.models.selection import ModelTrial, asked_for, candidates, select
from schemas.base.errors import RefusedInput
from schemas.calibration import Calibration, CameraCalibration, Source
from schemas.mounting import Mounting
from schemas.parameters.calibration import CalibrationParameters

Floats = NDArray[np.float64]

STRIPE = 100
"""With so many points a frame shows a stripe, whatever it lies on."""
SEEN = 0.5
"""A camera sees a placement where so much of its stripe is explained by the object."""


@dataclass(frozen=True)
class CameraView:
    """What one camera saw of the reference object."""

    camera: int
    image_px: tuple[int, int]
    """Columns and rows."""
    stripes: Sequence[Floats]
    """For each of K placements the stripe's points (N, 2), px; empty where there are none."""
    mounting: Mounting
    lost: tuple[int, ...] = ()
    """Frames that cannot be decoded."""


@dataclass(frozen=True)
class Recognised:
    """A view in which the object is recognised."""

    view: CameraView
    first: FirstMap
    rough: CameraFit
    """With the object where it was said to stand, and a lens."""

    @property
    def doubts(self) -> list[str]:
        """What looks like a mistake in the capture, a line each."""
        camera = f"camera {self.view.camera}"
        found = [f"{camera}: frame {number} cannot be decoded and is not used" for number in self.view.lost]
        found += [
            f"{camera}: the object is not recognised in frame {number}, which is not used"
            for number, (stripe, share) in enumerate(zip(self.view.stripes, self.first.explained, strict=True))
            if len(stripe) >= STRIPE and share < SEEN
        ]
        if self.contradiction:
            found.append(f"{camera} {self.contradiction}")
        return found

    @property
    def contradiction(self) -> str | None:
        """What of it speaks against this being the camera's own film, or against the placements, if anything does."""
        said, seen = self.view.mounting, self.first.seen_from
        return f"sees the object from {seen}, expected from {said}" if seen.contradicts(said) else None


@dataclass(frozen=True)
class CalibratedView:
    """The calibration of one camera, and what it rests on."""

    calibration: CameraCalibration
    trials: list[ModelTrial]
    points: EdgePoints
    """What was used of the stripe."""
    corners: list[FoundCorner]


def recognise_view(view: CameraView, edges: Edges, placements: Floats) -> Recognised | str:
    """The object in the view of a camera, standing in its `placements` (K, 2), mm; or why it is not recognised."""
    try:
        first = recognise(view.stripes, edges, placements, view.mounting)
    except UnrecognisedError as reason:
        return str(reason)
    try:
        return Recognised(view, first, fit_view(view, first, edges, as_said(placements)))
    except UndeterminedError:
        return "too little of the stripe lies on the object"


def fit_view(view: CameraView, first: FirstMap, edges: Edges, poses: Floats, without: int | None = None) -> CameraFit:
    """The map that knows the lens, from placements in which the camera sees the object; one may be left out.

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


def as_said(placements: Floats) -> Floats:
    """Poses (K, 3), mm, mm and radians, of an object that stands in its `placements` (K, 2)."""
    return np.column_stack([placements, np.zeros(len(placements))])


def object_poses(recognised: Mapping[int, Recognised], edges: Edges, placements: Floats) -> Floats:
    """Where the object stood, as all cameras tell: (K, 3) mm, mm and radians. A single placement is what it is."""
    poses = as_said(placements)
    if len(placements) == 1:
        return poses
    return joined_poses({camera: known.rough for camera, known in recognised.items()}, edges, poses)[0]


def calibrate_view(
    recognised: Recognised, edges: Edges, poses: Floats, parameters: CalibrationParameters, source: str
) -> CalibratedView:
    """The calibration of one camera with the object in known `poses` (K, 3).

    Raises
    ------
    RefusedInput
        The model that was asked for cannot be fitted.
    """
    view = recognised.view
    points = fit_view(view, recognised.first, edges, poses).points
    observations = points.observations()
    tried = asked_for(candidates(observations.pixels, view.image_px), parameters)
    found, trials = select(tried, observations, view.camera, robust=True)
    if found is None:
        reason = trials[0].remark or "nothing can be held out"
        raise RefusedInput(source, f"no model can be judged: {reason}", field=f"camera {view.camera}")
    chosen = next(trial for trial in trials if trial.status == "chosen")
    calibration = calibrated(found, observations, chosen, view.image_px)
    return CalibratedView(calibration, trials, points, list(corners_in(calibration, view.stripes, edges, poses)))


def assemble(views: Sequence[CalibratedView], sources: list[Source], software: str, warnings: list[str]) -> Calibration:
    """One calibration of all cameras, with how well each two of them agree."""
    cameras = {view.calibration.camera: view.calibration for view in views}
    return Calibration(
        sources=sources,
        software=software,
        warnings=warnings,
        cameras=[cameras[camera] for camera in sorted(cameras)],
        pairs=pair_agreements(cameras, {view.calibration.camera: view.points for view in views}),
    )
