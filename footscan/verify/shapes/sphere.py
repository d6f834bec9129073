"""Spheres of known diameter in a cloud: the errors of their size and form.

ISO 20685-2 tests the surfaces of body scanners, those of feet among them, with calibrated bodies in several places of
the volume. What is evaluated here is what such tests with spheres have in common: the error of the diameter, and how
far the points lie from the sphere of least squares. The thickness of the shell of 95 % of them, as in ISO 10360-8 and
-13, is one that a few stray points do not decide.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from footscan.mesh.cells import cell_means, group_by_cell
from footscan.verify.shapes.fitting import Floats, as_vector, distinct_points, robust_deviation
from schemas.base.errors import Finding
from schemas.fits import SphereFit

LEAST_POINTS = 50
LEAST_IN_CAP = 8
MOST_UNEVEN = 0.015
"""Standard deviation of the patches' mean distances, in radii, from which a form is no sphere, as heels are none."""
LEAST_COVERED = 0.4
"""Share of a sphere's surface that must have points."""
SEEDS = 200
CAP = 0.7
"""Reach in radii of the cap around a seed through which a first sphere is put."""
TRIMMINGS, TRIM = 5, 3.0
"""So often it is put through anew, without points beyond so many times the median distance from it."""
SIZE_TOLERANCE = 0.15
"""Share of the radius by which that first sphere may be wrong."""
CELL = 1 / 15
"""Edge in radii of the cells that the cloud is thinned to for the search."""
SHELL = 0.05
"""Share of the radius within which points belong to a sphere."""
OUTLIER_SIGMAS = 5.0
LEAST_REACH_MM = 0.01
ROUGH_PASSES, PASSES = 3, 10
CONVINCING = 0.6
"""Share of a sphere's surface from which no better one is sought."""
SHARE = 0.95

DIRECTIONS = 400
"""Patches, of about 10 degrees across, that a sphere's surface is divided into."""
_NUMBER = np.arange(DIRECTIONS)
_Z = 1 - (2 * _NUMBER + 1) / DIRECTIONS
_TURN = _NUMBER * np.pi * (3 - np.sqrt(5))
PATCHES = cKDTree(np.column_stack([np.sqrt(1 - _Z**2) * np.cos(_TURN), np.sqrt(1 - _Z**2) * np.sin(_TURN), _Z]))
"""Their middles, unit vectors spread evenly along the spiral of Fibonacci."""


def fit_sphere(points: Floats, diameter_mm: float) -> SphereFit:
    """The sphere of known diameter that most of `points` lie on.

    Parameters
    ----------
    points : (N, 3) float64, mm, of any order
    diameter_mm : calibrated diameter

    Raises
    ------
    Finding
        The points are no numbers, too few, or lie on no sphere of about this diameter.
    """
    return find_spheres(points, diameter_mm)[0]


def find_spheres(points: Floats, diameter_mm: float) -> list[SphereFit]:
    """All spheres of known diameter in `points`, those with most points first; else as `fit_sphere`."""
    left = distinct_points(points)
    count = len(left)
    found = []
    while (centre := _rough_centre(left, diameter_mm / 2)) is not None:
        fit = _evaluated(left, centre, diameter_mm)
        if fit is not None:
            found.append(fit)
        taken = np.linalg.norm(left - centre, axis=1) <= (1 + 2 * SHELL) * diameter_mm / 2
        if fit is not None:
            taken |= np.linalg.norm(left - fit.centre_mm, axis=1) <= (1 + 2 * SHELL) * diameter_mm / 2
        left = left[~taken]
    if not found:
        raise Finding(f"no sphere of about {diameter_mm:g} mm among {count} distinct points, expected one or more")
    return sorted(found, key=lambda fit: (-fit.points, fit.centre_mm))


def _rough_centre(points: Floats, radius: float) -> Floats | None:
    """(3,) centre of the sphere of about `radius` of which the points cover most; None where they cover none.

    Through the points of a cap around each of many seeds a sphere is put, and moved onto all points near it.
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
    """Centre of the algebraic sphere x² + y² + z² = 2 c.p + k through most of `cap`; None if of another size."""
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
    """`centre` after one step of Gauss and Newton on the distances of `points` to the sphere of given `radius`."""
    outward = points - centre
    distance = np.linalg.norm(outward, axis=1)
    step: Floats = np.linalg.lstsq(outward / distance[:, None], distance - radius, rcond=None)[0]
    return centre + step


def _evaluated(points: Floats, centre: Floats, diameter_mm: float) -> SphereFit | None:
    """The figures of the sphere near `centre`; None where too little of it is left on a closer look."""
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
    """(N, 4) of the distances to a sphere, by a step of its centre against it and by one of its radius."""
    outward = points - centre
    return np.column_stack([outward / np.linalg.norm(outward, axis=1, keepdims=True), np.ones(len(points))])


def _thinnest_shell(distances: Floats) -> float:
    """Thickness of the thinnest shell that holds 95 % of the points."""
    ordered = np.sort(distances)
    held = int(np.ceil(SHARE * len(ordered)))
    return float(np.min(ordered[held - 1 :] - ordered[: len(ordered) - held + 1]))


def _diameter_uncertainty(points: Floats, centre: Floats, radius: float) -> float:
    """Standard uncertainty of the diameter from the scatter of the patches' means.

    Points of one patch share the errors of few stripes and cameras, so patches count and not points. The part of the
    sphere that is covered decides how far centre and diameter may trade: that is in the least squares' covariance.
    """
    means, directions = _patch_means(points, centre, radius)
    jacobian = _jacobian(directions, np.zeros(3))
    variance = float(means @ means) / max(1, len(means) - 4)
    return float(2 * np.sqrt(variance * np.linalg.inv(jacobian.T @ jacobian)[3, 3]))


def _patch_means(points: Floats, centre: Floats, radius: float) -> tuple[Floats, Floats]:
    """(K,) mean distances from the sphere, mm, of the points in its filled patches, and (K, 3) where these are."""
    patch = _patches(points - centre)
    counts = np.bincount(patch, minlength=DIRECTIONS)
    filled = counts > 0
    residual = np.linalg.norm(points - centre, axis=1) - radius
    return np.bincount(patch, residual, DIRECTIONS)[filled] / counts[filled], PATCHES.data[filled]


def _covered(outward: Floats) -> float:
    """Share of the patches of a sphere that hold one of the points in (N, 3) directions `outward`."""
    return len(np.unique(_patches(outward))) / DIRECTIONS


def _patches(outward: Floats) -> NDArray[np.intp]:
    """(N,) which of the sphere's patches each direction falls into."""
    lengths = np.linalg.norm(outward, axis=1, keepdims=True)
    return np.asarray(PATCHES.query(outward / np.maximum(lengths, 1e-12))[1], np.intp)
