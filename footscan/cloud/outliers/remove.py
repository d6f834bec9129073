"""Removal of the points that do not belong to the foot, by reason."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.contact import above_glass, estimate_glass, moved_warning
from footscan.cloud.lasers.apart import UNKNOWN, lasers_of
from footscan.cloud.lasers.choose import choose_lasers
from footscan.cloud.lasers.moments import of_any_laser
from footscan.cloud.lasers.parted import parted_mm
from footscan.cloud.outliers.body import body_range, is_apart
from footscan.cloud.outliers.clutter import is_island, is_static
from footscan.cloud.outliers.contested import NOT_CONTESTED, contested_ends
from footscan.cloud.outliers.ghost import is_ghost
from footscan.cloud.outliers.glass import is_below_sole, is_plate
from footscan.cloud.outliers.inside import is_inside
from footscan.cloud.outliers.levels import is_far, is_off_median
from footscan.cloud.outliers.off_surface import is_off_surface
from footscan.cloud.outliers.other_laser import is_of_other_laser
from footscan.cloud.outliers.support import END, ISOLATED, UNCONFIRMED, judge_segments
from footscan.cloud.points import camera_numbers
from footscan.cloud.views import View
from footscan.rows import distinct_numbers
from schemas.glass import GlassPlane
from schemas.parameters.outliers import OutlierParameters

Mask = NDArray[np.bool_]

REASONS = ("volume", "extrapolated", "end", "isolated", "unconfirmed", "glass", "clutter", "median", "laser")
"""Reasons to drop a point; the code of a reason is its position here, counted from 1."""
KEPT, NO_POINT = 0, 255
"""Codes of a point that is kept, and of one that there is not: the place of a stripe point in the plane of a laser that
did not draw it."""
NO_FOOT = ("isolated", "unconfirmed", "clutter")
"""Reasons that say of a point that it is not the foot."""
ROUNDS = 3
"""Rounds in which segments are judged, each without those that were dropped before: what is no foot confirms, and
hides, other things that are none."""
CLUTTERED = 0.02
"""Share of a camera's points that were isolated or unconfirmed from which its stripes need the confirmation of another
camera. Cameras in a dark room without mirrors have less. Chosen by hand."""
REACH_MARGIN_MM, REGION_MARGIN_MM = 5.0, 10.0
"""By how much the control volume exceeds the first and the last frame, and the calibrated region: frames are placed to
millimetres, and a map may hold a little beyond its control points. Chosen by hand."""
STRIPE_GAPS = 3.0
"""Points of one stripe may be so many `gap_mm` apart where it is asked whether the volume cuts it. Chosen by hand."""
MUCH = 0.1
"""Share of a camera's points that are not the foot from which a warning is given. Chosen by hand."""


@dataclass(frozen=True)
class Removed:
    """The points that were dropped, and their reasons."""

    codes: NDArray[np.uint8]
    """(N,): `KEPT` or the code of the reason, for each input point."""
    counts: dict[int, dict[str, int]]
    """Camera -> reason -> number of points; all reasons, for each camera that has points."""
    warnings: list[str]
    """A sentence for each camera much of whose points are not the foot, or that sees the foot where it is cut off; and
    one on a plate that was moved."""
    glass: GlassPlane
    """The glass on which the foot stands; points were judged by their height above it."""
    parted_mm: NDArray[np.float32]
    """As of `parted_mm`, for each point that is kept; infinite where no other lasers were looked for."""
    lasers: NDArray[np.float64] = field(default_factory=UNKNOWN.copy)
    """As of `lasers_of`."""
    contested_mm: tuple[float, float] = NOT_CONTESTED
    """As of `contested_ends`; nothing is contested where no other cameras were asked."""

    def without(self, points: NDArray[np.void], selected: Mask, reason: str) -> "Removed":
        """The report if of the `points` (N,) those kept ones (K,) that are `selected` are dropped, too."""
        codes = self.codes.copy()
        codes[np.flatnonzero(codes == KEPT)[selected]] = 1 + REASONS.index(reason)
        counts = _count(camera_numbers(points), codes)
        return replace(self, codes=codes, counts=counts, parted_mm=self.parted_mm[~selected])


def remove_outliers(
    points: NDArray[np.void],
    views: Mapping[int, View],
    parameters: OutlierParameters,
    filmed: Mapping[int, NDArray[np.float64]] | None = None,
) -> tuple[NDArray[np.void], Removed]:
    """Drop the points that cannot belong to the foot.

    They are dropped in this order:

    - stripe points of which it is not known which of two lasers drew them, and those of other heads' lasers ("laser");
    - points outside the control volume ("volume"), and points that the calibration does not support ("extrapolated");
    - the foot's mirror image and the glass itself ("glass"), wherever skin shows the plate to be, see
      `estimate_glass`; then static objects, and all that is seen where no foot is ("clutter"): they would confirm each
      other;
    - the last points of a stripe where other cameras see the same place within their stripes ("end"), segments of
      stripe without any before and behind them ("isolated"), and segments that other cameras should see, but do not,
      or that lie behind a surface on which more cameras agree, points off the surface that the stripes around them
      make, and points inside the skin of an end ("unconfirmed");
    - parts apart from the rest that are small, or on which cameras do not agree ("clutter" again).

    With the method `levels` they are dropped without the evidence of other cameras, as in the thesis: points far from
    all others ("isolated"), then those outside the control volume ("volume"), then those that lie beside the median of
    their stripe ("median").

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, mm, scanner frame, of all cameras; those of cameras that see two lasers twice, once
        for each of their views
    views : number -> view; only cameras listed here are expected to confirm what another camera saw
    filmed : view -> X of its laser plane in the frames that it has, mm: a camera that saw nothing there denies what
        others saw. Of a camera that is missing here only frames with points count

    Returns
    -------
    The points that are kept, in their order, and a report of the others.

    Examples
    --------
    >>> from footscan.cloud.points import make_points
    >>> points = make_points(np.array([[0.0, 0.0, 1e6]]), camera=3)
    >>> kept, removed = remove_outliers(points, {}, OutlierParameters(z_mm=(-20.0, 200.0)))
    >>> print(len(kept), removed.counts[3]["volume"])
    0 1
    """
    choice = choose_lasers(points)
    codes = np.where(choice.other, NO_POINT, KEPT).astype(np.uint8)
    codes[choice.unassigned] = 1 + REASONS.index("laser")

    kept = np.flatnonzero(codes == KEPT)
    remaining = points.take(kept)

    def drop(reason: str, select: Callable[[NDArray[np.void]], Mask]) -> None:
        """Drop what `select` selects among the points that are left."""
        nonlocal kept, remaining
        if kept.size and (selected := select(remaining)).any():
            codes[kept[selected]] = 1 + REASONS.index(reason)
            left = np.flatnonzero(~selected)
            kept, remaining = kept[left], remaining.take(left)

    volume = control_volume(views, parameters, filmed)
    if parameters.method == "levels":
        drop("isolated", lambda left: is_far(left, parameters.nearest_mm))
        drop("volume", lambda left: _outside(left, volume))
        drop("median", lambda left: is_off_median(left, parameters.median_mm))
        counts, parted = _count(camera_numbers(points), codes), parted_mm(remaining, remaining[:0])
        return remaining, Removed(codes, counts, [], GlassPlane(), parted)
    drop("volume", lambda left: _outside(left, volume))
    if parameters.drop_unsupported:
        drop("extrapolated", lambda left: ~left["supported"])
    glass = estimate_glass(remaining, views)

    def drop_glass(select: Callable[[NDArray[np.void], Mapping[int, View], float], Mask]) -> None:
        drop("glass", lambda left: select(above_glass(left, glass.plane), views, parameters.glass_mm))

    drop_glass(is_plate)
    drop("laser", lambda left: is_of_other_laser(left, views))
    body = _body(remaining, views, parameters)
    drop("clutter", lambda left: is_static(left, parameters.static_share, body, filmed) | _is_beside(left, body))
    drop("glass", lambda left: is_ghost(left, views, parameters.gap_mm, parameters.segment_mm))
    drop_glass(is_below_sole)
    _drop_by_segment(points, codes, views, parameters, filmed)
    kept = np.flatnonzero(codes == KEPT)
    remaining = points.take(kept)
    drop_glass(is_plate)  # without what seemed to be its sides
    drop("unconfirmed", is_off_surface)
    drop("unconfirmed", is_inside)
    if body is not None:
        drop("clutter", is_apart)
    drop("clutter", lambda left: is_island(left, parameters.island_gap_steps, parameters.island_share))
    camera = camera_numbers(points)
    counts = _count(camera, codes)
    warnings = [
        *_warnings(camera[codes != NO_POINT], counts),
        *_cut_warnings(points, codes, parameters, views),
        *moved_warning(glass, parameters.glass_mm),
    ]
    denied, mistaken = (points.compress(codes == 1 + REASONS.index(reason)) for reason in ("unconfirmed", "laser"))
    contested = contested_ends(remaining, denied, of_any_laser(mistaken, views))
    parted = parted_mm(remaining, mistaken)
    return remaining, Removed(codes, counts, warnings, glass, parted, lasers_of(views), contested)


def _drop_by_segment(
    points: NDArray[np.void],
    codes: NDArray[np.uint8],
    views: Mapping[int, View],
    parameters: OutlierParameters,
    filmed: Mapping[int, NDArray[np.float64]] | None,
) -> None:
    """Write the codes of points that are isolated, unconfirmed, or at an end of a stripe into `codes` (N,)."""
    for last in [False] * (ROUNDS - 1) + [True]:
        left = np.flatnonzero(codes == KEPT)
        if not left.size:
            return
        verdicts = judge_segments(points.take(left), views, parameters, filmed, _cluttered(points["camera"], codes))
        for reason, verdict in (("isolated", ISOLATED), ("unconfirmed", UNCONFIRMED)):
            codes[left[verdicts == verdict]] = 1 + REASONS.index(reason)
        if last or not np.any((verdicts == ISOLATED) | (verdicts == UNCONFIRMED)):
            codes[left[verdicts == END]] = 1 + REASONS.index("end")
            return


def _cluttered(camera: NDArray[np.uint8], codes: NDArray[np.uint8]) -> list[int]:
    """Views that see much in the planes of the foot that is not the foot, as far as it was judged."""
    shares = _shares(camera[codes != NO_POINT], _count(camera, codes), ("isolated", "unconfirmed"))
    return [number for number, share in shares.items() if share > CLUTTERED]


def _shares(
    camera: NDArray[np.integer], counts: Mapping[int, Mapping[str, int]], reasons: Iterable[str]
) -> dict[int, float]:
    """Camera -> share of its points that were dropped for one of these reasons."""
    points, chosen = np.bincount(camera), tuple(reasons)
    return {number: sum(of[reason] for reason in chosen) / int(points[number]) for number, of in counts.items()}


def _warnings(camera: NDArray[np.integer], counts: Mapping[int, Mapping[str, int]]) -> Iterator[str]:
    much = {number: share for number, share in _shares(camera, counts, NO_FOOT).items() if share > MUCH}
    if much:
        yield (
            f"{_of_points(much)} are not the foot and were dropped: bright or shining things are in sight, or the room "
            "is bright; backgrounds filmed with the laser off take them away"
        )


def _of_points(shares: Mapping[int, float]) -> str:
    """Name the cameras, and the share of their points.

    >>> print(_of_points({3: 0.21}), "|", _of_points({1: 0.2, 2: 0.04, 5: 0.13}))
    camera 3: 21 % of its points | cameras 1, 2 and 5: 4 to 20 % of their points
    """
    percent = sorted(round(100 * share) for share in shares.values())
    numbers = [str(number) for number in sorted(shares)]
    if len(numbers) == 1:
        return f"camera {numbers[0]}: {percent[0]} % of its points"
    span = str(percent[0]) if percent[0] == percent[-1] else f"{percent[0]} to {percent[-1]}"
    return f"cameras {', '.join(numbers[:-1])} and {numbers[-1]}: {span} % of their points"


def _body(
    left: NDArray[np.void], views: Mapping[int, View], parameters: OutlierParameters
) -> tuple[float, float] | None:
    """Least and greatest X of the body; None if too few cameras can confirm each other."""
    cameras = views.keys() & set(np.unique(left["camera"]).tolist())
    return body_range(left) if len(cameras) >= parameters.fewest_cameras else None


def _is_beside(left: NDArray[np.void], body: tuple[float, float] | None) -> Mask:
    """Select the points before and behind the body."""
    if body is None:
        return np.zeros(len(left), np.bool_)
    return np.asarray((left["x"] < body[0]) | (left["x"] > body[1]))


def control_volume(
    views: Mapping[int, View], parameters: OutlierParameters, filmed: Mapping[int, NDArray[np.float64]] | None = None
) -> NDArray[np.float64]:
    """Limits in X, Y and Z (3, 2), mm, of what can be the foot: those of the parameters, or those of the scanner.

    The scanner reaches along X from the first frame to the last, and in Y and Z as far as any camera's calibration.
    Where that is not known, the volume is not limited.

    >>> from footscan.cloud.views import View
    >>> view = View(np.zeros(3), np.array([[-90.0, 0.0], [90.0, 0.0], [0.0, 100.0]]))
    >>> limits = control_volume({1: view}, OutlierParameters(z_mm=(-20.0, 110.0)), {1: np.array([2.0, 300.0])})
    >>> print(limits.tolist())
    [[-3.0, 305.0], [-100.0, 100.0], [-20.0, 110.0]]
    """
    limits = np.tile([-math.inf, math.inf], (3, 1))
    places = [x[np.isfinite(x)] for x in (filmed or {}).values()]
    if any(x.size for x in places):
        along = np.concatenate(places)
        limits[0] = along.min() - REACH_MARGIN_MM, along.max() + REACH_MARGIN_MM
    if views and all(len(view.outline) for view in views.values()):
        corners = np.concatenate([view.outline for view in views.values()])
        limits[1:, 0], limits[1:, 1] = corners.min(axis=0) - REGION_MARGIN_MM, corners.max(axis=0) + REGION_MARGIN_MM
    for axis, given in enumerate((parameters.x_mm, parameters.y_mm, parameters.z_mm)):
        if given is not None:
            limits[axis] = given
    return limits


def _outside(points: NDArray[np.void], volume: NDArray[np.float64]) -> Mask:
    inside = np.ones(len(points), np.bool_)
    for axis, (low, high) in zip("xyz", volume, strict=True):
        inside &= (points[axis] >= low) & (points[axis] <= high)  # false for NaN
    return ~inside


def _cut_warnings(
    points: NDArray[np.void],
    codes: NDArray[np.uint8],
    parameters: OutlierParameters,
    views: Mapping[int, View],
) -> Iterator[str]:
    """Say which cameras see the foot beyond the control volume or the calibrated region.

    What lies above the region does not count: there the leg goes on.
    """
    order = np.lexsort([points["source"], points["frame"], points["camera"]])
    ordered, code = points.take(order), codes[order]
    apart = (
        np.linalg.norm(np.stack([np.diff(ordered[axis]) for axis in "yz"]), axis=0) > STRIPE_GAPS * parameters.gap_mm
    )
    apart |= (np.diff(ordered["frame"]) != 0) | (np.diff(ordered["camera"]) != 0)
    stripe = np.concatenate([[0], np.cumsum(apart)]) if len(ordered) else np.empty(0, np.int64)
    of_foot = np.bincount(stripe, code == KEPT) > 0 if len(ordered) else np.empty(0, np.bool_)
    top = np.full(256, math.inf)
    for number, view in views.items():
        if len(view.outline):
            top[number] = view.outline[:, 1].max()
    cut = np.isin(code, [1 + REASONS.index(reason) for reason in ("volume", "extrapolated")]) & of_foot[stripe]
    cut &= ordered["z"] < top[ordered["camera"]] - REGION_MARGIN_MM
    camera = camera_numbers(ordered)
    kept, beyond = np.bincount(camera, code == KEPT), np.bincount(camera, cut)
    shares = beyond / np.maximum(beyond + kept, 1)
    much = {int(camera): float(shares[camera]) for camera in np.flatnonzero(shares > parameters.largest_cut)}
    if much:
        yield (
            f"{_of_points(much)} on the foot lie outside the control volume or the part of the picture that the "
            "calibration supports, and were dropped: place the foot in the middle, or calibrate with a larger object"
        )


def _count(camera: NDArray[np.integer], codes: NDArray[np.uint8]) -> dict[int, dict[str, int]]:
    camera, codes = camera[codes != NO_POINT], codes[codes != NO_POINT]
    cameras, index = distinct_numbers(camera)
    counts = np.zeros((len(cameras), len(REASONS) + 1), np.int64)
    np.add.at(counts, (index, codes), 1)
    return {
        int(number): dict(zip(REASONS, of_camera[1:].tolist(), strict=True))
        for number, of_camera in zip(cameras, counts, strict=True)
    }
