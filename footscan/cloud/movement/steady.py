"""Movement of the foot while it was scanned: a tremor, and a slow movement across the travel, are taken back."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.fusion.stripes import sort_stripes
from footscan.cloud.movement.passes import first_moment
from footscan.cloud.movement.sway import sway_of
from footscan.cloud.movement.tremor import MOVED_BACK, find_tremor
from footscan.cloud.points import copied
from schemas.movement import MovementReport

DOUBT_MM = 0.4
"""Slow movement from which no measure is relied upon. Chosen by hand: it is 0.3 to 0.36 mm where little is seen of a
foot that stands still (`draw_assembled`, seed 6228, filmed) and of two that sway by 0.2 mm (`draw_moving`, seeds 7422
and 7442), and 0.44 of two that sway by 0.7 mm at 0.2 Hz (seeds 1104 and 1303)."""
SWAYED_MM = 0.1
"""Slow movement across the travel from which a person is asked to scan again. Chosen by hand."""


def steadied(
    points: NDArray[np.void], heads: Mapping[int, int], first_moments: Mapping[int, int] = MappingProxyType({})
) -> tuple[NDArray[np.void], MovementReport]:
    """Move the points of a foot that trembles or sways back to where it is on average.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, mm, scanner frame, of all cameras, without outliers
    heads : camera -> number of its head, another one in each pass
    first_moments : camera -> moment of its frame 0; default: 0
    """
    first = {camera: moment for camera, moment in first_moments.items() if moment}
    of_moment = copied(points)
    of_moment["frame"] += first_moment(points, first)
    steady, report = _steadied(of_moment, heads)
    steady["frame"] = points["frame"]
    return steady, report.model_copy(update={"first_moments": first})


def _steadied(points: NDArray[np.void], heads: Mapping[int, int]) -> tuple[NDArray[np.void], MovementReport]:
    """`steadied`, of points whose frames are moments."""
    stripes = sort_stripes([points])
    report = find_tremor(stripes, heads)
    if report.x_mm:
        points = _moved_back(points, ("x", "plane"), np.array(report.x_mm), report.first_frame)
        stripes = sort_stripes([points])
    sway = sway_of(stripes, heads)
    if sway is None:
        return points, report
    x, y = (round(size, 4) for size in sway.sizes_mm)
    size = math.hypot(*sway.sizes_mm)
    report = report.model_copy(update={"sway_mm": round(size, 4), "sway_by_axis_mm": (x, y)})
    if size > DOUBT_MM:
        # A head that loses steps shows the same skin at another place, too.
        doubt = (
            f"the foot moved slowly, by {size:.1f} mm (root mean square), or a head lost steps: see that the foot "
            "stands still and nothing brakes the heads, then scan again"
        )
        return points, report.model_copy(update={"warnings": [*report.warnings, doubt], "doubt": doubt})
    warnings = list(report.warnings)
    if len(sway.y_mm) and y >= SWAYED_MM:
        warnings.append(f"the foot swayed by {y:.2f} mm across the travel {MOVED_BACK}")
    left = {
        "warnings": warnings,
        "y_mm": np.round(sway.y_mm, 4).tolist(),
        "left_x_mm": round(sway.left_x_mm, 4),
        "left_y_mm": np.round(sway.left_y_mm, 4).tolist(),
        "left_y_frames": round(sway.left_y_frames, 3),
    }
    report = report.model_copy(update=left)
    return _moved_back(points, ("y",), sway.y_mm, 0), report


def _moved_back(
    points: NDArray[np.void], names: Sequence[str], way: NDArray[np.float64], first_frame: int
) -> NDArray[np.void]:
    """The points without the `way` (F,) of each frame from the first one on, in the coordinates `names`."""
    moved = copied(points)
    frame = points["frame"].astype(np.intp) - first_frame
    is_near = (frame >= 0) & (frame < len(way))
    for name in names:
        moved[name][is_near] -= way[frame[is_near]].astype(np.float32)
    return moved
