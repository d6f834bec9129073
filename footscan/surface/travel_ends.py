"""Where the surface ends along the travel: at heel and toes, which no stripe meets squarely."""

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import PLANE_MM

REACH_MM = 0.3
"""A sheet of laser light is that thick to either side: it lights a tip that its middle does not reach, or just does,
and the points lie on the sheet's middle nevertheless."""
AROUND_MM = 8.0
"""How far around the last stripe the one before it is looked at; the tip of a neighbouring toe lies farther away."""
FEWEST = 3

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


def travel_ends(points: Floats, step_mm: float) -> tuple[Mask, tuple[float, float]]:
    """Points of a cloud that only graze a tip, and where nothing lies beyond.

    A round tip that ends at a distance d behind the last stripe has there a part d / (d + step) of its section one
    step before. Where that part is as small as d = `REACH_MM` makes it, the stripe tells that the tip is about there,
    and no more. Beyond another last stripe, the surface ends within a step, for there would be another one.

    Parameters
    ----------
    points : (N, 3) mm, in stripe planes of constant X

    Returns
    -------
    grazing : (N,) points of such stripes
    ends : least and greatest X in mm
    """
    grazing = np.zeros(len(points), np.bool_)
    ends = []
    for outermost, inward in ((points[:, 0].min(), 1), (points[:, 0].max(), -1)):
        last = np.abs(points[:, 0] - outermost) < PLANE_MM
        before = np.abs(points[:, 0] - outermost - inward * step_mm) < PLANE_MM
        low, high = points[last, 1:].min(axis=0) - AROUND_MM, points[last, 1:].max(axis=0) + AROUND_MM
        before &= ((points[:, 1:] > low) & (points[:, 1:] < high)).all(axis=1)
        is_tip = before.sum() >= FEWEST and _extent(points[last]) < REACH_MM / (REACH_MM + step_mm) * _extent(
            points[before]
        )
        if is_tip:
            grazing |= last
        ends.append(float(outermost - inward * (REACH_MM if is_tip else step_mm)))
    return grazing, (ends[0], ends[1])


def _extent(points: Floats) -> float:
    """Area in mm² of the upright box around a stripe."""
    return float(np.prod(np.ptp(points[:, 1:], axis=0)))
