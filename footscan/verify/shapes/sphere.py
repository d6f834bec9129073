"""Spheres of known diameter in a cloud: the errors of their size and form.

ISO 20685-2 tests the surfaces of body scanners, including foot scanners, with calibrated bodies in several places of
the volume. This module evaluates what such tests with spheres have in common: the error of the diameter, and the
distances of the points from the sphere of least squares. The thickness of the shell that holds 95 % of them, as in ISO
10360-8 and -13, is not decided by a few stray points.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from footscan.mesh.cells import cell_means, group_by_cell
from footscan.verify.shapes.fitting import Floats, as_vector, distinct_points, robust_deviation
from schemas.base.errors import Finding
from schemas.fits import SphereFit

LEAST_POINTS = 50
"""Least number of points of a sphere; chosen by hand."""
LEAST_IN_CAP = 8
"""Least number of points of a cap; chosen by hand."""
MOST_UNEVEN = 0.015
"""Largest standard deviation of the patches' mean distances, in radii, of a sphere; heels exceed it. Chosen by hand."""
LEAST_COVERED = 0.4
"""Least share of a sphere's surface that has points; chosen by hand."""
SEEDS = 200
"""Bound of time: caps to which a first sphere is fitted."""
CAP = 0.7
"""Reach in radii of the cap around a seed; chosen by hand."""
TRIMMINGS, TRIM = 5, 3.0
"""Number of fits to a cap; each leaves out points beyond this multiple of the median distance. Chosen by hand."""
SIZE_TOLERANCE = 0.15
"""Largest error of the radius of that first sphere, as a share of it; chosen by hand."""
CELL = 1 / 15
"""Edge in radii of the cells to which the cloud is thinned for the search; chosen by hand."""
SHELL = 0.05
"""Points nearer to a sphere than this share of its radius belong to it; chosen by hand."""
OUTLIER_SIGMAS = 5.0
"""Points farther off than this number of robust standard deviations are outliers; chosen by hand."""
LEAST_REACH_MM = 0.01
"""Points nearer than this are never outliers."""
ROUGH_PASSES, PASSES = 3, 10
"""Steps of the fit in the search and in the evaluation."""
CONVINCING = 0.6
"""The search ends at a sphere that covers at least this share of its surface; chosen by hand."""
SHARE = 0.95
"""Share of the points in the thinnest shell, as in ISO 10360-8 and -13."""

DIRECTIONS = 400
"""Number of patches, about 10 degrees across, into which a sphere's surface is divided."""
_NUMBER = np.arange(DIRECTIONS)
_Z = 1 - (2 * _NUMBER + 1) / DIRECTIONS
_TURN = _NUMBER * np.pi * (3 - np.sqrt(5))
PATCHES = cKDTree(np.column_stack([np.sqrt(1 - _Z**2) * np.cos(_TURN), np.sqrt(1 - _Z**2) * np.sin(_TURN), _Z]))
"""Middles of the patches: unit vectors, spread evenly along the spiral of Fibonacci"""


def fit_sphere(points: Floats, diameter_mm: float) -> SphereFit:
    """Fit the sphere of known diameter on which most of `points` lie.

    Parameters
    ----------
    points : (N, 3) float64, mm, in any order
    diameter_mm : calibrated diameter

    Raises
    ------
    Finding
        The points are no numbers, too few, or lie on no sphere of about this diameter.
    """
    return find_spheres(points, diameter_mm)[0]


def find_spheres(points: Floats, diameter_mm: float) -> list[SphereFit]:
    """Fit all spheres of known diameter in `points`, those with most points first; parameters as in `fit_sphere`."""
    left = distinct_points(points)
    count = len(left)
    fits = []
    while (centre := _rough_centre(left, diameter_mm / 2)) is not None:
        fit = _evaluated(left, centre, diameter_mm)
        if fit is not None:
            fits.append(fit)
        taken = np.linalg.norm(left - centre, axis=1) <= (1 + 2 * SHELL) * diameter_mm / 2
        if fit is not None:
            taken |= np.linalg.norm(left - fit.centre_mm, axis=1) <= (1 + 2 * SHELL) * diameter_mm / 2
        left = left[~taken]
    if not fits:
        raise Finding(f"no sphere of about {diameter_mm:g} mm among {count} distinct points, expected one or more")
    return sorted(fits, key=lambda fit: (-fit.points, fit.centre_mm))


def _rough_centre(points: Floats, radius: float) -> Floats | None:
    """Returns (3,) the centre of the sphere of about `radius` of which the points cover most; None without a sphere.

    A sphere is fitted to a cap around each of many seeds, and then moved onto all points near it.
    """
    if len(points) < LEAST_POINTS:
        return None
    order, starts = group_by_cell(points, np.full(3, CELL * radius))
    thinned = cell_means(points, order, starts, np.ones(len(points)))
    tree = cKDTree(thinned)

    def within(centre: Floats, reach: float) -> Floats:
        inside: Floats = thinned[tree.query_ball_point(centre.tolist(), reach * radius)]
        return inside

    best, most = None, LEAST_COVERED
    for seed in thinned[:: max(1, len(thinned) // SEEDS)]:
        centre = _cap_centre(within(seed, CAP), radius)
        for _ in range(ROUGH_PASSES):
            if centre is not None:
                near = _near_shell(within(centre, 1 + 2 * SHELL), centre, radius, 2 * SHELL)
                centre = _stepped(near, centre, radius) if len(near) >= LEAST_IN_CAP else None
        if centre is not None:
            covered = _covered(_near_shell(within(centre, 1 + SHELL), centre, radius, SHELL) - centre)
            if covered > most:
                best, most = centre, covered
            if covered > CONVINCING:
                break
    return best


def _cap_centre(cap: Floats, radius: float) -> Floats | None:
    """Centre c of the algebraic sphere |p|² = 2 c·p + k through most points p of `cap`; None if its size is wrong."""
    for _ in range(TRIMMINGS):
        if len(cap) < LEAST_IN_CAP:
            return None
        middle = cap.mean(axis=0)
        centred = cap - middle
        system = np.column_stack([2 * centred, np.ones(len(cap))])
        solution, _, rank, _ = np.linalg.lstsq(system, np.sum(centred**2, axis=1), rcond=1e-9)
        if rank < 4:
            return None
        centre: Floats = middle + solution[:3]
        size = float(np.sqrt(max(solution[3] + solution[:3] @ solution[:3], 0.0)))
        off = np.abs(np.linalg.norm(cap - centre, axis=1) - size)
        cap = cap[off <= TRIM * np.median(off) + 1e-9]
    return centre if abs(size - radius) <= SIZE_TOLERANCE * radius else None


def _near_shell(points: Floats, centre: Floats, radius: float, share: float) -> Floats:
    near: Floats = points[np.abs(np.linalg.norm(points - centre, axis=1) - radius) <= share * radius]
    return near


def _stepped(points: Floats, centre: Floats, radius: float) -> Floats:
    """`centre` after one Gauss-Newton step on the distances of `points` to the sphere of the given `radius`."""
    outward = points - centre
    distance = np.linalg.norm(outward, axis=1)
    step: Floats = np.linalg.lstsq(outward / distance[:, None], distance - radius, rcond=None)[0]
    return centre + step


def _evaluated(points: Floats, centre: Floats, diameter_mm: float) -> SphereFit | None:
    """Evaluate the sphere near `centre`; None if the points are too few, too uneven or cover too little of it."""
    nominal = diameter_mm / 2
    radius, reach = nominal, SHELL * nominal
    for _ in range(PASSES):
        distance = np.linalg.norm(points - centre, axis=1)
        within = np.abs(distance - radius) <= reach
        kept = points[within]
        if len(kept) < LEAST_POINTS:
            return None
        jacobian = _jacobian(kept, centre)
        residual = np.linalg.norm(kept - centre, axis=1) - radius
        step = np.linalg.lstsq(jacobian, residual, rcond=None)[0]
        centre, radius = centre + step[:3], radius + float(step[3])
        reach = float(np.clip(OUTLIER_SIGMAS * robust_deviation(residual), LEAST_REACH_MM, SHELL * nominal))
    stray = np.abs(np.linalg.norm(points - centre, axis=1) - radius) <= SHELL * nominal
    covered = _covered(kept - centre)
    if covered < LEAST_COVERED or abs(radius - nominal) > SHELL * nominal:
        return None
    if np.std(_patch_means(kept, centre, radius)[0]) > MOST_UNEVEN * nominal:
        return None

    fixed = centre
    for _ in range(PASSES):
        fixed = _stepped(kept, fixed, nominal)
    radial = np.linalg.norm(kept - centre, axis=1)
    off_nominal = np.linalg.norm(kept - fixed, axis=1) - nominal
    return SphereFit(
        centre_mm=as_vector(centre),
        nominal_mm=diameter_mm,
        diameter_mm=2 * radius,
        diameter_error_mm=2 * radius - diameter_mm,
        diameter_uncertainty_mm=_diameter_uncertainty(kept, centre, radius),
        radial_sd_mm=float(radial.std()),
        radial_range95_mm=_thinnest_shell(radial),
        radial_range_mm=float(np.ptp(radial)),
        fixed_centre_mm=as_vector(fixed),
        fixed_rms_mm=float(np.sqrt(np.mean(off_nominal**2))),
        fixed_mean_mm=float(off_nominal.mean()),
        fixed_range95_mm=_thinnest_shell(off_nominal),
        points=len(kept),
        outliers=int(np.count_nonzero(stray & ~within)),
        covered=covered,
    )


def _jacobian(points: Floats, centre: Floats) -> Floats:
    """Returns (N, 4) the derivatives of the distances to a sphere by its centre and radius, all with opposite sign."""
    outward = points - centre
    return np.column_stack([outward / np.linalg.norm(outward, axis=1, keepdims=True), np.ones(len(points))])


def _thinnest_shell(distances: Floats) -> float:
    """Thickness of the thinnest shell that holds 95 % of the points."""
    ordered = np.sort(distances)
    held = int(np.ceil(SHARE * len(ordered)))
    return float(np.min(ordered[held - 1 :] - ordered[: len(ordered) - held + 1]))


def _diameter_uncertainty(points: Floats, centre: Floats, radius: float) -> float:
    """Standard uncertainty of the diameter from the scatter of the patches' means.

    Points of one patch share the errors of few stripes and cameras, so patches count and not points. The covered part
    of the sphere decides the correlation of centre and diameter, which is in the covariance of the least squares.
    """
    means, directions = _patch_means(points, centre, radius)
    jacobian = _jacobian(directions, np.zeros(3))
    variance = float(means @ means) / max(1, len(means) - 4)
    return float(2 * np.sqrt(variance * np.linalg.inv(jacobian.T @ jacobian)[3, 3]))


def _patch_means(points: Floats, centre: Floats, radius: float) -> tuple[Floats, Floats]:
    """Returns (K,) the mean distances from the sphere, mm, in its filled patches, and (K, 3) their directions."""
    patch = _patches(points - centre)
    counts = np.bincount(patch, minlength=DIRECTIONS)
    filled = counts > 0
    residual = np.linalg.norm(points - centre, axis=1) - radius
    return np.bincount(patch, residual, DIRECTIONS)[filled] / counts[filled], PATCHES.data[filled]


def _covered(outward: Floats) -> float:
    """Share of the patches of a sphere that hold a point; `outward` are (N, 3) directions of the points."""
    return len(np.unique(_patches(outward))) / DIRECTIONS


def _patches(outward: Floats) -> NDArray[np.intp]:
    """Returns (N,) the number of the patch of each direction."""
    lengths = np.linalg.norm(outward, axis=1, keepdims=True)
    return np.asarray(PATCHES.query(outward / np.maximum(lengths, 1e-12))[1], np.intp)
