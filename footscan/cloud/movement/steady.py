"""Movement of the foot while it was scanned: a tremor is taken back, slow movement is reported."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.fusion.stripes import sort_stripes
from footscan.cloud.movement.sway import sway_of
from footscan.cloud.movement.tremor import find_tremor
from schemas.movement import MovementReport

DOUBT_MM = 0.3
"""Slow movement from which no measure is relied upon: its size is known to a factor of two. Chosen by hand, after feet
that sway (`draw_assembled`, seeds 1101 to 1106)."""


def steadied(points: NDArray[np.void], heads: Mapping[int, int]) -> tuple[NDArray[np.void], MovementReport]:
    """Move the points of a foot that trembles back to where it is on average, and estimate its slow movement.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, mm, scanner frame, of all cameras, without outliers
    heads : camera -> number of its head; frames of all heads with one number are of one moment
    """
    stripes = sort_stripes([points])
    report = find_tremor(stripes, heads)
    if report.x_mm:
        points = _moved_back(points, report)
        stripes = sort_stripes([points])
    sizes = sway_of(stripes, heads)
    if sizes is None:
        return points, report
    sway = math.hypot(*sizes)
    x, y = (round(size, 4) for size in sizes)
    report = report.model_copy(update={"sway_mm": round(sway, 4), "sway_by_axis_mm": (x, y)})
    if sway <= DOUBT_MM:
        return points, report
    # A head that loses steps shows the same skin at another place, too.
    doubt = (
        f"the foot moved slowly, by {sway:.1f} mm (root mean square), or a head lost steps: see that the foot stands "
        "still and nothing brakes the heads, then scan again"
    )
    return points, report.model_copy(update={"warnings": [*report.warnings, doubt], "doubt": doubt})


def _moved_back(points: NDArray[np.void], tremor: MovementReport) -> NDArray[np.void]:
    moved, way = points.copy(), np.array(tremor.x_mm)
    frame = points["frame"].astype(np.intp) - tremor.first_frame
    is_near = (frame >= 0) & (frame < len(way))
    for name in ("x", "plane"):
        moved[name][is_near] -= way[frame[is_near]].astype(np.float32)
    return moved
