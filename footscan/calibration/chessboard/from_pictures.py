"""Calibration of a camera from pictures of a chessboard, with and without the laser stripe."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chessboard.camera_fit import BoardView, CameraFit, Glass, fit_camera
from footscan.calibration.chessboard.pinhole import UndeterminedPinholeError
from footscan.calibration.chessboard.sheet import UndeterminedPlaneError, across_travel
from footscan.calibration.models.fit import ModelFit, UndeterminedError, fit
from footscan.calibration.models.homography import HomographyModel, image_frame
from footscan.calibration.models.laser_plane import MIDDLE_Z_MM
from footscan.calibration.models.observations import of_points
from footscan.calibration.models.region import region_of, supported
from footscan.calibration.models.selection import rms
from schemas.base.errors import RefusedInput
from schemas.calibration import CameraCalibration, Residual

Floats = NDArray[np.float64]

FOLDS = 10
"""Number of parts of the pictures that are held out in turn, at most: a bound of time."""
GRID = 24
"""Places a side of the region at which the map is fitted to the pinhole."""
LARGEST_MISFIT_MM = 0.02
"""Distance between the map and the pinhole up to which no correction is added; that of an accurate calibration. Chosen
by hand."""
CORRECTIONS = (None, 2, 3, 4)
"""Orders of the correction that are tried."""
LARGEST_FOCAL_SD = 0.02
"""Relative standard deviation of a focal length beyond which the poses of the board are too much alike. Chosen by
hand."""


@dataclass(frozen=True)
class Sheet:
    """Where the laser plane of a camera lies in the scanner's frame, see `schemas.calibration.LaserPlane`."""

    values: Floats
    """(3,) X at Y = 0 and Z = 57, mm; yaw and pitch."""
    deviations: Floats
    """(3,) their standard deviations, without those of the placed boards; NaN if unknown."""


@dataclass(frozen=True)
class BoardCalibration:
    """The result for one camera."""

    camera: CameraCalibration
    """Without the laser plane."""
    fit: CameraFit
    sheet: Sheet
    views: int
    placed: int
    """Views at a known place."""
    corners_px: float
    """Distance of the corners from where they are projected to, root mean square."""
    misfit_mm: float
    """Largest distance between the map and the pinhole within the region."""


def calibrate_camera(
    camera_id: int, views: Sequence[BoardView], image_px: tuple[int, int], glass: Glass | None, source: str
) -> BoardCalibration:
    """Calibrate a camera from views of the board.

    The pinhole's sight of the laser plane is fitted by a homography with distortion. The covariance of the map is that
    of a jackknife: parts of the pictures are left out in turn (B. Efron and C. Stein, "The jackknife estimate of
    variance", Annals of Statistics 9(3), 1981, 586-596, doi:10.1214/aos/1176345462). A single placed picture stays in
    all parts. The error on held-out pictures is that between the map of the others and the place on the board, whose
    pose is known from its corners.

    Parameters
    ----------
    views : as `usable_views` finds them.
    glass : on which feet stand; None if no camera looks through it.
    source : names the pictures in messages.

    Raises
    ------
    RefusedInput
        The views do not determine the camera or its laser plane.
    """
    field = f"camera {camera_id}"
    try:
        whole = fit_camera(views, image_px, glass)
        sheet = np.array(across_travel(whole.plane.seen_from(whole.scanner), MIDDLE_Z_MM))
    except (UndeterminedPinholeError, UndeterminedPlaneError) as undetermined:
        raise RefusedInput(source, str(undetermined), field=field) from None
    if whole.focal_sd > LARGEST_FOCAL_SD:
        problem = (
            f"the focal length is known to {100 * whole.focal_sd:.0f} % only, expected more pictures of boards that "
            "are tilted by 20 to 45 degrees to different sides"
        )
        raise RefusedInput(source, problem, field=field)
    region = region_of(np.concatenate([view.pixels for view in views]))
    pixels = _grid(region)
    if not np.isfinite(whole.world(pixels)).all():
        raise RefusedInput(source, "the laser plane passes through the camera, expected it before it", field=field)
    model, fitted, misfit = _fitted_map(whole, pixels, image_px, (source, field))
    folds = [_without(views, number, image_px, glass, model, pixels) for number in range(_fold_count(views))]
    known = [fold for fold in folds if fold is not None]
    complete = len(known) == len(folds) > 1
    covariance = _jackknife(np.array([fold.parameters for fold in known])) if complete else None
    sheet_sd = np.sqrt(np.diagonal(_jackknife(np.array([fold.sheet for fold in known])))) if complete else None
    errors = _errors(model, fitted.parameters, whole, views)
    held_out = np.concatenate([fold.distances for fold in known]) if complete else np.empty(0)
    distances = np.concatenate([np.linalg.norm(part, axis=1) for part in errors])
    document = CameraCalibration(
        camera=camera_id,
        image_px=image_px,
        map=model.as_map(fitted.parameters),
        covariance=[] if covariance is None else [row[: k + 1].tolist() for k, row in enumerate(covariance)],
        condition=fitted.condition,
        region_px=region,
        points=len(distances),
        rms_mm=rms(distances),
        held_out_rms_mm=rms(held_out) if len(held_out) else None,
        worst_mm=float(held_out.max() if len(held_out) else distances.max()),
        residuals=_residuals(views, errors),
    )
    return BoardCalibration(
        document,
        whole,
        Sheet(sheet, np.full(3, np.nan) if sheet_sd is None else sheet_sd),
        len(views),
        sum(view.place is not None for view in views),
        whole.corners_px,
        misfit,
    )


@dataclass(frozen=True)
class _Fold:
    """The calibration without one part of the pictures."""

    parameters: Floats
    """(P,) of the map."""
    sheet: Floats
    """(3,) as in `Sheet`."""
    distances: Floats
    """(N,) mm, of the points of the stripe in the pictures left out."""


def _fold_count(views: Sequence[BoardView]) -> int:
    return min(FOLDS, len(_may_be_left_out(views)))


def _may_be_left_out(views: Sequence[BoardView]) -> list[int]:
    """Numbers of the views: all, or all but the only placed one."""
    placed = [number for number, view in enumerate(views) if view.place is not None]
    return [number for number in range(len(views)) if len(placed) > 1 or number not in placed]


def _without(
    views: Sequence[BoardView],
    fold: int,
    image_px: tuple[int, int],
    glass: Glass | None,
    model: HomographyModel,
    pixels: Floats,
) -> _Fold | None:
    """Calibrate without the part number `fold`; None if the other pictures do not determine everything."""
    out = set(_may_be_left_out(views)[fold :: _fold_count(views)])
    try:
        rest = fit_camera([view for number, view in enumerate(views) if number not in out], image_px, glass)
        sheet = np.array(across_travel(rest.plane.seen_from(rest.scanner), MIDDLE_Z_MM))
        world = rest.world(pixels)
        if not np.isfinite(world).all():
            return None
        parameters = fit(model, of_points(pixels, world, np.arange(len(pixels))), robust=False).parameters
        parts = [
            model.world(parameters, stripe.pixels) - rest.board_world(stripe.pixels, rest.pose_of(view))
            for number, view in enumerate(views)
            if number in out and (stripe := view.stripe) is not None
        ]
    except (UndeterminedPinholeError, UndeterminedPlaneError, UndeterminedError):
        return None
    return _Fold(parameters, sheet, np.linalg.norm(np.concatenate([np.empty((0, 2)), *parts]), axis=1))


def _jackknife(values: Floats) -> Floats:
    """Covariance (P, P) of parameters, from their `values` (F, P) without each of F parts of the data.

    >>> print(_jackknife(np.array([[1.0], [2.0], [3.0]])).round(6))
    [[1.333333]]
    """
    rest = values - values.mean(axis=0)
    return np.asarray((len(values) - 1) / len(values) * rest.T @ rest)


def _grid(region: list[tuple[float, float]]) -> Floats:
    """Pixels (N, 2) over a region, its corners included."""
    corners = np.array(region)
    low, high = corners.min(axis=0), corners.max(axis=0)
    i, j = np.meshgrid(*(np.linspace(low[k], high[k], GRID) for k in (0, 1)))
    grid = np.column_stack([i.ravel(), j.ravel()])
    return np.concatenate([grid[supported(region, grid)], corners])


def _fitted_map(
    camera: CameraFit, pixels: Floats, image_px: tuple[int, int], where: tuple[str, str]
) -> tuple[HomographyModel, ModelFit, float]:
    """The stiffest model that follows the pinhole, its fit, and its largest distance, mm, at `pixels` (N, 2)."""
    world = camera.world(pixels)
    observations = of_points(pixels, world, np.arange(len(pixels)))
    centre, scale = image_frame(image_px)
    best: tuple[HomographyModel, ModelFit, float] | None = None
    for correction in CORRECTIONS:
        model = HomographyModel(centre, scale, True, correction)
        try:
            fitted = fit(model, observations, robust=False)
        except UndeterminedError:
            continue
        misfit = float(np.linalg.norm(model.world(fitted.parameters, pixels) - world, axis=1).max())
        if best is None or misfit < best[2]:
            best = model, fitted, misfit
        if misfit <= LARGEST_MISFIT_MM:
            break
    if best is None:
        raise RefusedInput(
            where[0], "no map follows the camera, expected boards over more of the image", field=where[1]
        )
    return best


def _errors(model: HomographyModel, parameters: Floats, camera: CameraFit, views: Sequence[BoardView]) -> list[Floats]:
    """Errors (N, 2), mm, in Y and Z at the stripe on each board that has one."""
    return [
        model.world(parameters, view.stripe.pixels) - camera.board_world(view.stripe.pixels, pose)
        for view, pose in zip(views, camera.poses, strict=True)
        if view.stripe is not None
    ]


def _residuals(views: Sequence[BoardView], errors: Sequence[Floats]) -> list[Residual]:
    """The mean error across each square of each board, with its mean pixel."""
    rows: list[Residual] = []
    stripes = [view.stripe for view in views if view.stripe is not None]
    for stripe, error in zip(stripes, errors, strict=True):
        for square in np.unique(stripe.square):
            on = stripe.square == square
            (i, j), (y, z) = stripe.pixels[on].mean(axis=0).round(2), error[on].mean(axis=0).round(5)
            rows.append((float(i), float(j), float(y), float(z)))
    return rows
