"""Comparisons of cameras at skin that several of them see, and how each changes with the places of the heads."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.laser_plane import MIDDLE_Z_MM
from footscan.cloud.fusion.agreement import GAP_STEPS, find_overlaps
from footscan.cloud.fusion.motion import TERMS, motion_terms
from footscan.cloud.fusion.stripes import Floats, Traces, sort_stripes, traces_of, ways_to_neighbours
from footscan.cloud.points import copied, stripe_step
from footscan.cloud.views import View

Ints = NDArray[np.intp]

REACH_MM = 6.0
"""Distance along the normal up to which stripes may show the same skin: heads that are millimetres off displace them by
about as much. Chosen by hand."""
SLOPE_REACH_MM = 12.0
"""The same for successive stripes of one camera."""
STEEPEST = 3.0
"""Slope of the skin along X beyond which a chord between stripes does not tell it. Chosen by hand."""
HEAD_TERMS = 4
"""Numbers of `schemas.heads.HeadPlace`: offset, yaw, pitch, scale."""
RIGID = TERMS["rigid"]
STRETCH_MM = 20.0
"""Errors of comparisons within such a stretch of the travel are correlated. Chosen by hand."""
UNBOUNDED = np.array([[-1e6, -1e6], [1e6, 1e6]])


class Comparisons(NamedTuple):
    """M comparisons of a point of one camera with the stripe of another one."""

    distance: Floats
    """(M,) from the point to the other stripe, along the point's normal in the laser plane, mm"""
    variance: Floats
    """(M,) mm^2, as expected"""
    cameras: Ints
    """(M, 2) indices of the point's camera and of the other one"""
    heads: Ints
    """(M, 2) indices of their heads"""
    along_sight: Floats
    """(M, 2) how far the place at which each of them sees the point moves along the normal if the laser plane moves by
    1 mm along X; the skin stays"""
    slope: Floats
    """(M,) how far the skin moves along the normal from one plane to one 1 mm ahead; NaN if it is not known"""
    terms: Floats
    """(M, 4) derivatives of X by the numbers of a head"""
    rigid: Floats
    """(M, 3) derivatives of the distance by a rigid motion of a camera in the laser plane"""
    stretch: Ints
    """(M,) number of the stretch of the travel"""
    laser: Ints
    """(M,) index of the head whose laser made the point"""

    def every(self, step: int) -> "Comparisons":
        """One comparison of `step`."""
        columns = {name: values[::step] for name, values in self._asdict().items()}
        return self._replace(**columns)

    @property
    def is_across(self) -> NDArray[np.bool_]:
        """(M,) true if the two cameras are on different heads."""
        return np.asarray(self.heads[:, 0] != self.heads[:, 1])


def compare(
    points: NDArray[np.void],
    lasers: NDArray[np.intp],
    views: Mapping[int, View],
    head_of: NDArray[np.intp],
    x_mm: float,
    reach_mm: float = REACH_MM,
) -> Comparisons:
    """Compare the cameras.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, mm, scanner frame, of cameras that have views
    lasers : (N,) index of the head whose laser made each point
    head_of : (256,) index of the head of each camera
    x_mm : where offsets hold
    reach_mm : largest distance along the normal
    """
    labelled = copied(points)
    labelled["cameras"] = lasers  # rides through the sort
    stripes = sort_stripes([labelled])
    overlaps = find_overlaps(stripes, stripes.yz, reach_mm)
    point = overlaps.point
    cameras = np.column_stack([stripes.camera[point], overlaps.other])
    normals, yz = stripes.normals[point], stripes.yz[point]
    centres = np.array([views[int(camera)].centre for camera in stripes.cameras]).reshape(-1, 3)
    along_sight = np.zeros((len(point), 2))
    for k in (0, 1):
        sight = centres[cameras[:, k]] - np.column_stack([np.zeros(len(point)), yz])
        along_sight[:, k] = np.einsum("nk,nk->n", normals, sight[:, 1:] / sight[:, :1])
    distinct, place = np.unique(point, return_inverse=True)
    slopes = _slopes(
        distinct,
        GAP_STEPS * stripe_step(stripes.points),
        max(len(stripes.cameras), 1),
        traces_of(stripes, stripes.yz, stripes.sigma),
    )
    motion = motion_terms(yz, np.array([0.0, MIDDLE_Z_MM]), np.tile(UNBOUNDED, (len(point), 1, 1)))[:, :, :RIGID]
    x = stripes.x[point]
    return Comparisons(
        overlaps.distance,
        overlaps.variance,
        cameras,
        head_of[stripes.cameras][cameras],
        along_sight,
        slopes[place] if len(point) else np.zeros(0),
        terms_of_head(np.column_stack([x, yz]), x_mm),
        np.einsum("nk,nkt->nt", normals, motion),
        np.floor(x / STRETCH_MM).astype(np.intp),
        stripes.points["cameras"][point].astype(np.intp),
    )


def terms_of_head(xyz: Floats, x_mm: float) -> Floats:
    """Derivatives (N, 4) of the X of points (N, 3), mm, by offset, yaw, pitch and scale of a head.

    >>> print(terms_of_head(np.array([[110.0, 20.0, 67.0]]), 100.0))
    [[ 1. 20. 10. 10.]]
    """
    x, y, z = xyz.T
    return np.column_stack([np.ones(len(x)), y, z - MIDDLE_Z_MM, x - x_mm])


def _slopes(sample: Ints, gap: float, cameras: int, traces: Traces) -> Floats:
    """How far the skin moves along the normals of points per mm of X, from the stripes before and after; or NaN."""
    before, x_before, after, x_after = ways_to_neighbours(sample, SLOPE_REACH_MM, gap, cameras, traces).T
    apart = x_after - x_before
    slope = (after - before) / np.where(apart > 0.0, apart, np.nan)
    return np.where(np.abs(slope) < STEEPEST, slope, np.nan)
