"""Landmarks on the back of the foot and on the leg.

All functions take (N, 3) `points` of the surface of a right foot in its own frame, mm, and its length in mm.
"""

import numpy as np
from numpy.typing import NDArray

from footscan.measure.landmarks.dense_points import dense_points
from footscan.measure.landmarks.extreme import Cap, Floats, Point, height_at, highest_of_each, saddle
from footscan.measure.landmarks.sides import FULL_SIZE_MM
from footscan.mesh.rigid_transform import points_within
from footscan.mesh.topology import used_vertices

CORNER_MM = (50.0, 20.0)
"""X and Z of the corner inside the heel to which the crease between foot and leg is nearest, on a foot of
`FULL_SIZE_MM` or more; chosen by hand."""
CREASE_MM = 100.0
"""Height below which the crease lies on such a foot; chosen by hand."""
SECTOR_DEG = (10.0, 88.0)
"""Directions from the corner, above X, in which the outline is taken; chosen by hand."""
SECTORS = 39
"""Sectors of these directions, 2 degrees each."""
FRONT, SPACING_MM = 0.70, 1.5
"""Share of the length behind which the crease lies, and distance of the points used there; chosen by hand."""
NEAR_OUTLINE = 0.6
"""Points nearer to the corner than this share of the outline's distance belong to another part of the skin."""
INSTEP = (0.45, 0.60)
"""Shares of the length between which the instep point is sought; chosen by hand."""
INSTEP_FALLBACK = 0.50
"""Share of the length at which the instep point is placed if the ridge has no bend."""
STATION_MM = 2.0
"""Distance of the stations along the ridge."""
BEND_MM = 16.0
"""Half the length of the ridge over which its bend is fitted; chosen by hand."""
NOTABLE = 3.0
"""Standard deviations by which a bend exceeds those at the borders of the window; smaller ones are the roughness of the
skin."""
LEAST_BEND = 0.01
"""1/mm. Less bend than that of a circle of 100 mm radius is the even back of the foot, not a bone. Chosen by hand."""
NEAR_MM = 10.0
"""Radius of the surface that is fitted around a landmark; chosen by hand."""
BELOW_CUT_MM = 3.0
"""Margin below the end of the leg in which no landmark is sought; chosen by hand."""


def junction_point(vertices: Floats, faces: NDArray[np.integer], length: float, top: float) -> tuple[Point, Cap] | None:
    """Find the junction of the front of the leg and the back of the foot, and the cap that was fitted there.

    The junction is the point of the outline, seen from the side, that is nearest to a corner inside the heel. None if
    the leg was cut, at the height `top` in mm, below it.
    """
    scale = min(1.0, length / FULL_SIZE_MM)
    x, z = vertices[:, 0], vertices[:, 2]
    front = (x > CORNER_MM[0] * scale) & (x < FRONT * length) & (z > CORNER_MM[1] * scale)
    points = dense_points(*used_vertices(vertices, faces[front[faces].all(axis=1)]), SPACING_MM)
    corner_x, corner_z = CORNER_MM[0] * scale, CORNER_MM[1] * scale
    x, z = points[:, 0] - corner_x, points[:, 2] - corner_z
    angle, radius = np.arctan2(z, x), np.hypot(x, z)
    ahead = (angle > np.deg2rad(SECTOR_DEG[0])) & (angle < np.deg2rad(SECTOR_DEG[1]))
    angle, radius, y, z = angle[ahead], radius[ahead], points[ahead, 1], points[ahead, 2]
    if not len(radius):
        return None
    edges = np.deg2rad(np.linspace(*SECTOR_DEG, SECTORS + 1))
    sector = np.clip(np.searchsorted(edges, angle) - 1, 0, SECTORS - 1)
    farthest = highest_of_each(sector, radius, SECTORS)
    outline = np.where(farthest >= 0, radius[farthest], np.inf)
    outline[z[farthest] > min(top - BELOW_CUT_MM, CREASE_MM * scale)] = np.inf  # the cut does not belong to the outline
    nearest = int(np.argmin(outline))
    if nearest in (0, SECTORS - 1) or not np.isfinite(outline[nearest - 1 : nearest + 2]).all():
        return None
    start = np.array([y[farthest[nearest]], (edges[nearest] + edges[nearest + 1]) / 2])
    near = radius > NEAR_OUTLINE * outline[nearest]
    across = np.column_stack([y, angle * outline[nearest]])[near]
    fitted = saddle(across, radius[near], start * [1.0, outline[nearest]], NEAR_MM)
    if fitted is None:
        return None
    (saddle_y, arc), distance, cap = fitted
    turn = arc / outline[nearest]
    return np.array([corner_x + distance * np.cos(turn), saddle_y, corner_z + distance * np.sin(turn)]), cap


def instep_point(points: Floats, length: float) -> tuple[Point, bool] | None:
    """Find where the ridge of the foot's back bends most, at the cuneiform bones; True if there is such a bend.

    Without a notable bend it is the point of the ridge half way along the foot.
    """
    stations, ridge, ridge_y = _ridge(points, length)
    if len(stations) < 3:
        return None
    bend, sd = np.array([_bend(stations, ridge, x) for x in stations]).T
    inside = np.flatnonzero((stations >= INSTEP[0] * length) & (stations <= INSTEP[1] * length))
    if not len(inside):
        return None
    k = int(inside[np.argmax(bend[inside])])
    stands_out = bend[k] - max(bend[inside[0]], bend[inside[-1]], 0.0) > NOTABLE * sd[k]
    is_bend = inside[0] < k < inside[-1] and stands_out and bend[k] > LEAST_BEND
    x = float(stations[k]) if is_bend else INSTEP_FALLBACK * length
    if is_bend:  # between the stations
        before, at, after = bend[k - 1 : k + 2]
        x += STATION_MM * 0.5 * (before - after) / min(before - 2 * at + after, -1e-9)
    y, z = (float(np.interp(x, stations, values)) for values in (ridge_y, ridge))
    return np.array([x, y, z]), bool(is_bend)


def metatarsal_top(points: Floats, tibiale: Point, fibulare: Point, share: float) -> Point | None:
    """Find the back of the foot above the line between both metatarsal points; None if there is no surface.

    Parameters
    ----------
    share : of the way from the medial point to the lateral one
    """
    place = tibiale[:2] + share * (fibulare[:2] - tibiale[:2])
    x, y = ((float(at) - NEAR_MM, float(at) + NEAR_MM) for at in place)
    above = points_within(points, x, y, ((tibiale[2] + fibulare[2]) / 2, np.inf))
    height = height_at(above[:, :2], above[:, 2], place, NEAR_MM)
    return None if height is None else np.array([*place, height])


def _ridge(points: Floats, length: float) -> tuple[Floats, Floats, Floats]:
    """Returns X of stations along the instep, and Z and Y of the highest point at each."""
    first, last = INSTEP[0] * length - BEND_MM, INSTEP[1] * length + BEND_MM
    back = points[(points[:, 0] >= first) & (points[:, 0] < last)]
    station = ((back[:, 0] - first) / STATION_MM).astype(np.intp)
    order = np.lexsort([back[:, 2], station])
    highest = back[order[np.flatnonzero(np.diff(station[order], append=-1))]]
    return highest[:, 0], highest[:, 2], highest[:, 1]


def _bend(stations: Floats, ridge: Floats, x: float) -> tuple[float, float]:
    """Returns the curvature of the ridge at `x`, 1/mm, positive if convex upwards, and its standard deviation."""
    near = np.abs(stations - x) <= BEND_MM
    terms = np.vander((stations[near] - x) / BEND_MM, 3)
    factors = np.linalg.lstsq(terms, ridge[near], rcond=None)[0]
    spare = max(int(near.sum()) - 3, 1)
    variance = float(np.sum((ridge[near] - terms @ factors) ** 2)) / spare * np.linalg.pinv(terms.T @ terms)[0, 0]
    steepness = (1 + (factors[1] / BEND_MM) ** 2) ** 1.5
    return -2 * factors[0] / BEND_MM**2 / steepness, 2 * float(np.sqrt(variance)) / BEND_MM**2 / steepness
