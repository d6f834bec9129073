"""A first, rough cuboid in a cloud: axes from the normals of small patches, faces from the places with most patches."""

import numpy as np
from scipy.spatial import cKDTree

from footscan.mesh.cells import cell_means, group_by_cell
from footscan.verify.shapes.fitting import Floats
from schemas.base.errors import Finding

CELL_MM = 1.0
"""Edge of the cells to which the cloud is thinned, since stripes have many more points along them than across.
Chosen by hand."""
NEIGHBOURS = 16
"""Points of a patch; chosen by hand."""
FLATNESS = 0.1
"""Largest ratio of thickness to width of a patch with a normal, as variances; chosen by hand."""
WIDTH = 0.1
"""Least ratio of width to length of a patch, as variances; below, it is a line. Chosen by hand."""
VOTERS = 400
"""Bound of time: normals that are candidates for an axis."""
NEAR_DEGREES = 8.0
"""Normals nearer than this to a direction vote for it; chosen by hand."""
FACE_DEGREES = 25.0
"""Patches whose normals are nearer than this to an axis may belong to its faces; chosen by hand."""
BIN_MM = 0.5
"""Width of the bins along an axis in which patches are counted."""
CREST_MM = 2.0
"""Distance from the foot of a crowd within which its crest is sought; chosen by hand."""
CROWD = 0.1
"""Least count of patches at a face, as a share of the largest count along the axis; chosen by hand."""
LEAST_PATCHES = 10
"""Least number of patches for an axis or a face; chosen by hand."""
LEAST_EXTENT_MM = 5.0
"""Faces nearer to each other than this are one; chosen by hand."""


def rough_box(points: Floats) -> tuple[Floats, Floats]:
    """Find the axes and faces of the cuboid on which most of `points` lie.

    Parameters
    ----------
    points : (N, 3) float64, mm, scanner frame

    Returns
    -------
    axes : (3, 3) unit vectors as rows, right-handed, nearest to X, Y and Z in this order, accurate to a degree or two
    limits : (3, 2) mm, places of the lower and the upper face along each axis; NaN for a face that was not seen

    Raises
    ------
    Finding
        There are no two faces at a right angle.
    """
    patches, normals = _patch_normals(points)
    axes = _axes_of(normals)
    limits = np.array([_crowds(patches @ axis, normals @ axis) for axis in axes])
    if np.isnan(limits).all(axis=1).sum() > 1:
        raise Finding("the points lie on no two faces at a right angle, expected a cuboid")
    return axes, limits


def _patch_normals(points: Floats) -> tuple[Floats, Floats]:
    """Returns (P, 3) centres and (P, 3) unit normals, of either sign, of the flat patches."""
    order, starts = group_by_cell(points, np.full(3, CELL_MM))
    thinned = cell_means(points, order, starts, np.ones(len(points)))
    if len(thinned) < NEIGHBOURS:
        raise Finding(f"the points fill {len(thinned)} mm³ cells, expected a cuboid")
    _, nearest = cKDTree(thinned).query(thinned, NEIGHBOURS)
    patches = thinned[nearest]
    patches -= patches.mean(axis=1, keepdims=True)
    variance, vectors = np.linalg.eigh(np.einsum("pki,pkj->pij", patches, patches))
    flat = (variance[:, 0] < FLATNESS * variance[:, 1]) & (variance[:, 1] > WIDTH * variance[:, 2])
    return thinned[flat], vectors[flat, :, 0]


def _axes_of(normals: Floats) -> Floats:
    """Returns (3, 3) the direction of most normals, that of most normals at right angles to it, and the third."""
    first = _most_common(normals)
    second = None
    if first is not None:
        beside = normals[np.abs(normals @ first) < np.sin(np.radians(2 * NEAR_DEGREES))]
        second = _most_common(beside)
    if first is None or second is None:
        raise Finding("the points lie on no two faces at a right angle, expected a cuboid")
    second -= (second @ first) * first
    second /= np.linalg.norm(second)
    return _nearest_to_scanner(np.array([first, second, np.cross(first, second)]))


def _most_common(normals: Floats) -> Floats | None:
    """Returns (3,) the direction near most normals, regardless of sign; None if hardly any agree."""
    voters = normals[:: max(1, len(normals) // VOTERS)]
    if not len(voters):
        return None
    near = np.cos(np.radians(NEAR_DEGREES))
    votes = [int(np.count_nonzero(np.abs(normals @ voter) > near)) for voter in voters]
    best = int(np.argmax(votes))
    if votes[best] < LEAST_PATCHES:
        return None
    agreeing = normals[np.abs(normals @ voters[best]) > near]
    direction: Floats = np.linalg.eigh(agreeing.T @ agreeing)[1][:, 2]
    return direction


def _nearest_to_scanner(axes: Floats) -> Floats:
    """Order `axes` and choose their signs so that they are nearest to X, Y and Z."""
    up = int(np.argmax(np.abs(axes[:, 2])))
    rest = [k for k in range(3) if k != up]
    along = max(rest, key=lambda k: abs(axes[k, 0]))
    z = axes[up] * np.copysign(1.0, axes[up, 2])
    x = axes[along] * np.copysign(1.0, axes[along, 0])
    return np.array([x, np.cross(z, x), z])


def _crowds(along: Floats, cosine: Floats) -> tuple[float, float]:
    """Places of the outermost two crowds of patches that face along an axis; NaN for a crowd that does not exist."""
    facing = along[np.abs(cosine) > np.cos(np.radians(FACE_DEGREES))]
    if len(facing) < LEAST_PATCHES:
        return np.nan, np.nan
    start = float(facing.min()) - 2 * BIN_MM
    bins = np.bincount(((facing - start) / BIN_MM).astype(np.int64), minlength=4)
    crowd = np.convolve(bins, np.ones(3), "same")
    crowded = np.flatnonzero(crowd >= max(LEAST_PATCHES, CROWD * crowd.max()))
    if not len(crowded):
        return np.nan, np.nan
    reach = int(CREST_MM / BIN_MM)
    low = int(crowded[0] + np.argmax(crowd[crowded[0] : crowded[0] + reach]))
    last = int(crowded[-1])
    high = last - int(np.argmax(crowd[max(0, last - reach + 1) : last + 1][::-1]))
    lower, upper = start + (low + 0.5) * BIN_MM, start + (high + 0.5) * BIN_MM
    if upper - lower >= LEAST_EXTENT_MM:
        return lower, upper
    # One face: the body lies on the side where the other patches are.
    middle = float(np.mean(np.percentile(along, [2, 98])))
    return (lower, np.nan) if lower < middle else (np.nan, upper)
