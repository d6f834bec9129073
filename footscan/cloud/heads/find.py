"""Search for the places of the heads along the travel.

Where lasers of two heads reach the same skin, every camera sees the lines of both. A line that cameras of two heads see
is one line: they map it to one place if each knows where its own laser plane stands. A camera that was moved in its
laser plane also displaces it, but alike over the whole travel and alike for all lines.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.fusion.stripes import Floats
from footscan.cloud.heads.comparisons import Comparisons, compare
from footscan.cloud.heads.equations import (
    FoundPlaces,
    HeadFit,
    displacements,
    likeliest,
    merged_lines,
    same_line,
    solve,
    spread_unmoved,
    strays,
    unmoved_heads,
)
from footscan.cloud.heads.planes import (
    UNKNOWN,
    calibrated_places,
    displaced,
    head_indices,
    heads_of,
    planes_filmed,
    views_at,
)
from footscan.cloud.heads.start import first_places
from footscan.cloud.heads.verdict import HALF_MM, report_of
from footscan.cloud.lasers.choose import choose_lasers
from footscan.cloud.lasers.moments import renumbered
from footscan.cloud.lasers.seen import FARTHEST_MM, LasersSeen, lasers_seen
from footscan.cloud.points import copied
from footscan.cloud.views import View
from schemas.heads import HeadsReport
from schemas.parameters.heads import HeadParameters

FEWEST = 300
"""Comparisons of cameras of two heads, at least. Chosen by hand."""
USED = 9_000
"""Comparisons that are used at first, about: a bound of time."""
LINE_MM = 1.2
"""Lines of two lasers that are closer than this are not told apart in a picture: laser sheets are 0.7 mm wide (full
width at half maximum) and more. Chosen by hand."""
ROUNDS, SETTLED_MM = 5, 0.005
"""Rounds of assignment to lasers: a bound of time; and the change of a place at which they end."""
NEAR_MM = 3.0
"""Distance along the normal up to which stripes show the same skin, once lines are assigned to lasers. Chosen by
hand."""
THINNED = 3
"""One point of so many is used: they lie 0.3 mm apart along the stripe."""
STRANGE = 0.02
"""Share of points of other heads' lasers below which no camera sees them: the heads travel one after the other. Chosen
by hand."""


def find_heads(points: NDArray[np.void], views: Mapping[int, View], parameters: HeadParameters) -> HeadsReport:
    """Find where the heads are, relative to the calibration.

    Common places of all heads are not seen, and left at zero.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, mm, scanner frame, of all cameras, outliers included
    views : camera -> view; cameras without a view, or on no known head, take no part; of cameras that see two lasers,
        stripes of the first one do
    """
    heads = heads_of(views)
    head_of = head_indices(heads)
    choice = choose_lasers(points)
    has_head = head_of[points["camera"]] != UNKNOWN
    usable = points.compress(has_head & points["supported"] & ~choice.other & ~choice.unassigned)
    heads = {camera: head for camera, head in heads.items() if np.any(usable["camera"] == camera)}
    head_of = head_indices(heads)
    count = len(set(heads.values()))
    x_mm = round(float(np.median(usable["plane"])), 3) if len(usable) else 0.0
    nothing = HeadsReport(points=len(usable), x_mm=x_mm)
    if not parameters.correct_heads or count < 2:
        return nothing
    known = calibrated_places(views, heads, x_mm)
    unmoved = displaced(renumbered(usable, views), -known, head_of, x_mm)
    ordered = unmoved.take(np.lexsort([unmoved[name] for name in ("source", "camera", "frame")]))
    bare = {camera: replace(view, plane=None) for camera, view in views.items()}
    first = compare(ordered, head_of[ordered["camera"]], bare, head_of, x_mm)
    across = int(np.count_nonzero(first.is_across))
    if across < FEWEST:
        return nothing.model_copy(update={"comparisons": across})
    start = unmoved_heads(known, len(heads))
    strays_mm = 0.0
    if np.ptp(known[:, 0]) <= LINE_MM:
        start, unmoved_mm, strays_mm = first_places(first.every(-(-len(first.distance) // USED)), known, len(heads))
        fit = start
    if np.ptp(start.places[:, 0]) > LINE_MM:
        fit, unmoved_mm, strays_mm = _refined(ordered[::THINNED], bare, heads, start, known, x_mm)
    moved = fit.places - known
    fit = fit._replace(places=moved - moved.mean(axis=0))
    found = nothing.model_copy(update={"comparisons": across, "strays_mm": round(strays_mm, 4)})
    return report_of(found, heads, fit, unmoved_mm, parameters, filmed=planes_filmed(views, heads))


def _refined(
    points: NDArray[np.void],
    views: Mapping[int, View],
    heads: Mapping[int, int],
    fit: HeadFit,
    known: Floats,
    x_mm: float,
) -> FoundPlaces:
    """Places of the heads, from points that are assigned to lasers at those of `fit`, and again until they settle.

    The first places stay where frames of different heads are not of one moment, or no camera sees the lines of two
    heads: there a line of another head cannot be assigned.
    """
    head_of, explained = head_indices(heads), None
    for _ in range(ROUNDS):
        places = fit.places
        moved, views_there = displaced(points, places, head_of, x_mm), views_at(views, heads, places, x_mm)
        seen = lasers_seen(moved, views_there, heads)
        if not _is_of_one_moment(seen) or _travels_alone(seen, places):
            break
        of_laser, laser = _in_laser_planes(moved, seen)
        comparisons = compare(of_laser, laser, views, head_of, x_mm, NEAR_MM)
        change, distance = _of_lines(comparisons, fit)
        fit = solve(comparisons, change, distance, fit)
        explained = comparisons, change, distance
        if np.max(np.abs(fit.places - places) * HALF_MM) < SETTLED_MM:
            break
    if explained is None:
        return FoundPlaces(fit, fit.spread_mm)
    return FoundPlaces(fit, spread_unmoved(*explained, known, len(heads)), strays(*explained, fit))


def _is_of_one_moment(seen: LasersSeen) -> bool:
    """True if frames with one number, of cameras of all heads, were filmed with the heads about at one X."""
    apart = np.abs(seen.planes - seen.planes[seen.own, np.arange(len(seen.own))])
    return bool(np.nanmedian(apart) < FARTHEST_MM)


def _travels_alone(seen: LasersSeen, places: Floats) -> bool:
    """True if planes are apart by more than a line, and hardly a camera sees the line of another head."""
    return bool(np.ptp(places[:, 0]) > LINE_MM and np.mean(seen.laser != seen.own) < STRANGE)


def _in_laser_planes(points: NDArray[np.void], seen: LasersSeen) -> tuple[NDArray[np.void], NDArray[np.intp]]:
    """The points in the planes of their lasers, and the index of each laser."""
    moved = copied(points)
    for number in range(len(seen.places)):
        rows = np.flatnonzero((seen.laser == number) & (seen.own != number))
        moved["x"][rows], moved["y"][rows], moved["z"][rows] = seen.places[number, rows].T
        moved["plane"][rows] = seen.planes[number, rows]
    usable = np.isfinite(moved["y"]) & np.isfinite(moved["x"])
    return moved.compress(usable), seen.laser[usable]


def _of_lines(comparisons: Comparisons, fit: HeadFit) -> tuple[Floats, Floats]:
    """Derivatives (M, H) of the distances, and the distances (M,), mm, that the places of the heads must explain."""
    x, count = comparisons.terms @ fit.places.T, len(fit.places)
    rows = np.arange(len(x))
    first, second = comparisons.heads.T
    close = np.abs(x[rows, first] - x[rows, second]) < LINE_MM
    merged = comparisons.is_across & (comparisons.laser == first) & close
    either = [same_line(comparisons, head, count) for head in (first, second)]
    of_merged = likeliest(comparisons, [*either, merged_lines(comparisons, count)], comparisons.distance, fit)
    lines = same_line(comparisons, comparisons.laser, count)
    moved = displacements(lines, comparisons, fit.places)  # points are where their lasers are
    change = np.where(merged[:, None], of_merged, lines)
    return change, comparisons.distance + np.where(merged, 0.0, moved)
