"""What is wrong with a placement, while the object still stands there and can be moved."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.edge_points import edge_distances
from footscan.calibration.capture.from_capture import (
    SEEN,
    STRIPE,
    CameraView,
    Recognised,
    nominal_poses,
    recognise_view,
)
from footscan.calibration.capture.judged_placement import LEAST_SHARE, in_words, judge_by
from footscan.calibration.capture.lines import find_lines
from footscan.calibration.capture.placement import CameraFit, departure
from footscan.calibration.capture.recognition import EXPLAINED_MM
from footscan.calibration.capture.reference import Edges
from footscan.calibration.models.maps import is_supported, to_world
from schemas.calibration import Calibration

Floats = NDArray[np.float64]

JUDGED_BY = 4
"""Number of the earlier placements, the latest ones, by which a placement is judged: a bound of time."""
EARLIER_TOLERANCE_MM = 3.0
"""Departure that is reported if only an earlier calibration judges, which may have drifted. Chosen by hand."""
SMALLEST_TURN = np.radians(0.5)
"""Turn from which it is named; it moves the corners by 0.4 mm."""
SMALLEST_MM = 0.1
"""Way from which a direction is named."""
LONG_PX = 25.0
"""Length from which a straight piece shows whether the stripe moved. Chosen by hand."""
NEAR_PX = 8.0
"""Distance from a straight piece within which its points are searched in a later frame. Chosen by hand."""
REMAINING = 0.5
"""Share of a straight piece's points that a piece has that is found again. Chosen by hand."""
CHANGED = 0.2
"""Share of the length of all pieces from which those that are not found again count. Chosen by hand."""
STILL_PX = 0.5
"""Largest way of the stripe between two frames of a scanner at rest, about 0.15 mm; noise makes 0.1 px. Chosen by
hand."""


@dataclass(frozen=True)
class Complaint:
    """One thing that is wrong with a placement."""

    kind: Literal["no stripe", "not recognised", "elsewhere", "moved", "saturated", "faint", "no picture"]
    words: str
    """What is wrong, and what to do."""
    cameras: tuple[int, ...] = ()
    """The cameras that show it; none: all of them together."""


class Judgement(NamedTuple):
    """What was found in the frames of a placement."""

    complaints: list[Complaint]
    on_object: dict[int, NDArray[np.bool_]]
    """(N,) which points of each camera's stripe lie on the object, and not on a reflection of it; a camera that does
    not recognise the object is left out."""


def judge_standing(
    views: Mapping[int, CameraView],
    edges: Edges,
    placements: Floats,
    tolerance_mm: float,
    calibration: Calibration | None = None,
) -> Judgement:
    """Judge the last of the `placements` (K, 2), mm, by the views of all placements up to it.

    The place of the object is judged by maps that the earlier placements give. The first placement is judged by an
    earlier `calibration` of the scanner, if there is one.
    """
    first = max(0, len(placements) - 1 - JUDGED_BY)
    placements = placements[first:]
    views = {number: replace(view, stripes=view.stripes[first:], lost=()) for number, view in views.items()}
    dark = tuple(number for number, view in views.items() if len(view.stripes[-1]) < STRIPE)
    complaints = []
    if dark:
        remedy = "is the laser on, is anything in the way, does the object stand under the stripe?"
        complaints.append(Complaint("no stripe", f"no stripe in {in_words(dark)}: {remedy}", dark))
    lit = {number: view for number, view in views.items() if number not in dark}
    maps = _earlier_maps(lit, edges, placements)
    pose, stripes = nominal_poses(placements)[-1], {number: view.stripes[-1] for number, view in lit.items()}
    judged = judge_by(maps, {number: stripes[number] for number in maps}, edges, pose)
    change, allowed_mm, judge = (None, tolerance_mm, "")
    if judged is not None:
        change, allowed_mm = judged.change, tolerance_mm + judged.margin_mm
    elif worlds := _by_calibration(calibration, stripes):
        change, allowed_mm = departure(worlds, edges, pose), max(tolerance_mm, EARLIER_TOLERANCE_MM)
        judge = ", by the scanner's present calibration"
    if change is not None and change.share >= LEAST_SHARE and change.size_mm > allowed_mm:
        return Judgement([*complaints, Complaint("elsewhere", f"{direction_of(change.pose)}{judge}")], {})
    sure = {} if judged is None else judged.maps
    worlds_by_camera = {
        number: sure[number].world(stripes[number]) if number in sure else _world(view, edges, placements)
        for number, view in lit.items()
    }
    on_object = {
        number: edge_distances(edges, world - pose[:2])[1] < EXPLAINED_MM
        for number, world in worlds_by_camera.items()
        if world is not None
    }
    on_object = {number: lies for number, lies in on_object.items() if np.mean(lies) >= SEEN}
    blind = tuple(number for number in lit if number not in on_object)
    if blind and (len(placements) > 1 or not on_object):  # one frame may be too few for a camera
        whole = len(blind) == len(lit) > 1
        who = "any camera" if whole else in_words(blind)
        remedy = "is it this object, does it stand upright, does anything else stand on the glass?"
        words = f"the object is not recognised by {who}: {remedy}"
        complaints.append(Complaint("not recognised", words, () if whole else blind))
    return Judgement(complaints, on_object)


def points_on_object(view: CameraView, edges: Edges, placements: Floats) -> list[NDArray[np.bool_]]:
    """Tell which points of a camera's stripe lie on the object in each of its `placements` (K, 2), mm.

    All do if the camera does not recognise the object.
    """
    seen = recognise_view(view, edges, placements)
    if not isinstance(seen, Recognised):
        return [np.ones(len(stripe), np.bool_) for stripe in view.stripes]
    return [
        edge_distances(edges, seen.rough.world(stripe) - placement)[1] < EXPLAINED_MM
        for stripe, placement in zip(view.stripes, placements, strict=True)
    ]


def moved_px(before: Floats, after: Floats) -> float:
    """Measure how far the stripe moved between two frames of one camera, px: the largest way of a straight piece.

    If many pieces of each frame are not found in the other within `NEAR_PX`, that is the least way. Those of one frame
    alone are reflections, which come and go.

    Parameters
    ----------
    before, after : (N, 2) and (M, 2) points of the stripe, px.

    Examples
    --------
    >>> stripe = np.column_stack([np.arange(100.0), np.full(100, 40.0)])
    >>> print(moved_px(stripe, stripe + [0.0, 2.0]))
    2.0
    """
    ways, gone = _ways(before, after)
    _, new = _ways(after, before)
    return NEAR_PX if min(gone, new) > CHANGED else max(ways, default=0.0)


def direction_of(pose: Floats) -> str:
    """Describe the departure (3,) of the object from its placement, mm, mm, radians, and how to undo it.

    >>> print(direction_of(np.array([4.0, 0.0, 0.0])))
    the object stands 4.0 mm too far towards +Y: move it 4.0 mm towards -Y
    >>> print(direction_of(np.array([0.0, -2.0, np.radians(1.0)])))
    the object stands 2.0 mm too low and turned by 1.0 degrees from +Y to +Z: move it 2.0 mm up and turn it back
    """
    y, z, turn = pose.tolist()
    is_off, undo = [], []
    if abs(y) >= SMALLEST_MM:
        side, back = ("+Y", "-Y") if y > 0 else ("-Y", "+Y")
        is_off.append(f"{abs(y):.1f} mm too far towards {side}")
        undo.append(f"move it {abs(y):.1f} mm towards {back}")
    if abs(z) >= SMALLEST_MM:
        is_off.append(f"{abs(z):.1f} mm too {'high' if z > 0 else 'low'}")
        undo.append(f"move it {abs(z):.1f} mm {'down' if z > 0 else 'up'}")
    if abs(turn) >= SMALLEST_TURN:
        is_off.append(f"turned by {abs(np.degrees(turn)):.1f} degrees from +Y to {'+Z' if turn > 0 else '-Z'}")
        undo.append("turn it back")
    return f"the object stands {' and '.join(is_off)}: {' and '.join(undo)}"


def _ways(before: Floats, after: Floats) -> tuple[list[float], float]:
    """The ways of the straight pieces, px, and the share of their length that is not found again."""
    ways, gone, whole = [], 0.0, 0.0
    for line in find_lines(before):
        if line.length < LONG_PX:
            continue
        near = after[np.abs(line.positions(after)) < line.length / 2.0]
        off = line.distances(near)
        off = off[np.abs(off) < NEAR_PX]
        whole += line.length
        if len(off) < REMAINING * len(line.points):
            gone += line.length
        else:
            ways.append(abs(float(np.median(off) - np.median(line.distances(before[line.points])))))
    return ways, gone / whole if whole else 0.0


def _earlier_maps(views: Mapping[int, CameraView], edges: Edges, placements: Floats) -> dict[int, CameraFit]:
    """The maps that the placements before the last one give: without it, since it may be wrong."""
    if len(placements) < 2:
        return {}
    earlier = {number: replace(view, stripes=view.stripes[:-1]) for number, view in views.items()}
    seen = {number: recognise_view(view, edges, placements[:-1]) for number, view in earlier.items()}
    return {number: view.rough for number, view in seen.items() if isinstance(view, Recognised)}


def _by_calibration(calibration: Calibration | None, stripes: Mapping[int, Floats]) -> Sequence[Floats]:
    """The stripe of each calibrated camera, (N, 2) mm, where data support the map."""
    worlds = []
    for camera in calibration.cameras if calibration is not None else ():
        if camera.camera in stripes:
            stripe = stripes[camera.camera]
            worlds.append(to_world(camera, stripe[is_supported(camera, stripe)]))
    return worlds


def _world(view: CameraView, edges: Edges, placements: Floats) -> Floats | None:
    """The last stripe (N, 2), mm, by a map of all placements; None if the camera does not recognise the object."""
    seen = recognise_view(view, edges, placements)
    return seen.first.world(view.stripes[-1]) if isinstance(seen, Recognised) else None
