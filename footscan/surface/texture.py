"""The colour of a surface's vertices, from the colours of the stripe points around them."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from footscan.cloud.colour import CLIPPED_WEIGHT, as_level, camera_gains, is_clipped
from footscan.cloud.points import coordinates, stripe_step
from footscan.compiled import compiled
from footscan.mesh.buckets import Buckets, sort_into_cubes
from footscan.mesh.topology import directed_edges
from footscan.surface.ankle import faces_on_cut

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NEUTRAL = (200, 200, 200)
"""Grey levels of what has no colour of its own: the flat cut of the ankle."""
LIGHTEST, LIGHTEST_QUANTILE = 0.8, 0.99
"""All colours are exposed alike, so that this part of the surface is no lighter than this light,"""
NIGHT = 0.01
"""as if it had been as light as this at least: what is darker is noise."""
REACH_STEPS = 1.25
LEAST_REACH_MM = 1.5
"""Points so far along the surface give a vertex its colour: on one stripe at least, as a rule on two."""
STEEPEST = 0.25
"""Sine of the angle between surface and stripe planes below which stripes count as no farther apart along it."""
FLAT = 0.4
"""Points are sought in a lens along the surface, so many times as high as it is wide."""
GRAZING = 0.1
"""Cosine at which a camera's view of the skin counts for nothing."""
UNKNOWN_VIEW = 0.5
"""Cosine of the views of a camera whose place is not known."""
COMPARED = 6000
"""About so many vertices tell how much lighter one camera is than another."""


class _Seen(NamedTuple):
    """Points with colours, in the order in which compiled loops take them."""

    places: Floats
    """(N, 3) mm"""
    light: Floats
    """(N, 3)"""
    trust: Floats
    """(N,) factor of their weights"""
    camera: Ints
    """(N,) index into `centres`"""
    centres: Floats
    """(C, 3) mm, X counted from the laser plane; NaN where not known"""


def vertex_colours(
    vertices: Floats,
    normals: Floats,
    faces: NDArray[np.int32],
    filled: NDArray[np.bool_],
    points: NDArray[np.void],
    colours: NDArray[np.float32],
    centres: Mapping[int, Floats],
    cut_mm: float | None = None,
) -> NDArray[np.uint8]:
    """(V, 3) red, green and blue of the vertices as a picture has them (sRGB).

    A vertex takes the mean of the points around it on its side of the surface, by their distance and by how squarely
    their cameras look at it. The cameras' brightness and white balance are evened out first, by one gain a camera and
    channel, from where they see the same skin. Vertices that were filled, and those without points, continue the
    colours around them smoothly: each is the mean of its neighbours. At last all are exposed alike. Shades are left in,
    for the colours are those of the skin in the light of the room.

    Parameters
    ----------
    vertices, normals, faces, filled : (V, 3) mm, (V, 3) outward unit vectors, (F, 3), (V,); scanner frame
    points : (N,) array of `POINT_DTYPE`, mm, scanner frame: those of all cameras, before they were fused, that have
        a colour
    colours : (N, 3) of each, in linear light, 1 being white; see `point_colours`
    centres : of the cameras whose place is known (3,) mm, in the frame of the heads: X counts from the laser plane
    cut_mm : Z of the flat cut of the ankle, whose inside is grey, as is all where there are no colours
    """
    light = np.full((len(vertices), 3), np.nan)
    measured = np.flatnonzero(~filled)
    finite = np.isfinite(coordinates(points)).all(axis=1)
    points, colours = points[finite], colours[finite]
    step = max(stripe_step(points), LEAST_REACH_MM / REACH_STEPS)
    seen = _near(vertices[measured], points, colours, centres, step)
    if len(seen.places):
        light[measured] = _gathered(vertices[measured], normals[measured], seen, step)
    known = np.isfinite(light[:, 0])
    light, reached = _continued(light, known, faces)
    levels = np.full((len(vertices), 3), NEUTRAL, np.uint8)
    if np.any(known):
        exposure = LIGHTEST / max(np.quantile(light[known].max(axis=1), LIGHTEST_QUANTILE), NIGHT)
        levels[reached] = np.rint(255 * as_level(np.clip(exposure * light[reached], 0.0, 1.0)))
    if cut_mm is not None:
        levels[_inside_cut(vertices, faces, cut_mm) & filled] = NEUTRAL
    return levels


def _near(
    vertices: Floats,
    points: NDArray[np.void],
    colours: NDArray[np.float32],
    centres: Mapping[int, Floats],
    step: float,
) -> _Seen:
    """What is known of the points that lie in the box around the vertices."""
    places = coordinates(points)
    margin = REACH_STEPS * step / STEEPEST
    low, high = vertices.min(axis=0, initial=np.inf) - margin, vertices.max(axis=0, initial=-np.inf) + margin
    inside = ((places >= low) & (places <= high)).all(axis=1)
    cameras, camera = np.unique(points["camera"][inside], return_inverse=True)
    unknown = np.full(3, np.nan)
    stand = np.array([centres.get(int(number), unknown) for number in cameras]).reshape(-1, 3)
    light = colours[inside].astype(np.float64)
    trust = np.where(is_clipped(light), CLIPPED_WEIGHT, 1.0)
    return _Seen(places[inside], light, trust, camera.astype(np.int64), stand)


def _gathered(vertices: Floats, normals: Floats, seen: _Seen, step: float) -> Floats:
    """(V, 3) light of each vertex; NaN where there is no point around it."""
    buckets = sort_into_cubes(seen.places, REACH_STEPS * step)
    some = np.arange(0, len(vertices), max(len(vertices) // COMPARED, 1))
    no_gains = np.zeros((len(seen.centres), 3))
    sums = _sum_up(vertices[some], normals[some], seen, no_gains, True, step, buckets)
    gains = camera_gains(sums)
    light = _sum_up(vertices, normals, seen, gains, False, step, buckets)[:, 0]
    weight = light[:, 3:]
    means: Floats = np.divide(light[:, :3], weight, out=np.full_like(light[:, :3], np.nan), where=weight > 0)
    return means


@compiled
def _sum_up(
    vertices: Floats,
    normals: Floats,
    seen: _Seen,
    gains: Floats,
    apart: bool,
    step: float,
    buckets: Buckets,
) -> Floats:
    """(V, C or 1, 4) weighted light of the points around each vertex, and its weight; by camera, or of all."""
    places, light, camera, centres = seen.places, seen.light, seen.camera, seen.centres
    edge, low, dims, start, order = buckets.edge, buckets.low, buckets.dims, buckets.start, buckets.order
    factors = np.exp(-gains)
    sums = np.zeros((len(vertices), len(centres) if apart else 1, 4))
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for n in range(len(vertices)):
        x, y, z = vertices[n]
        nx, ny, nz = normals[n]
        radius = REACH_STEPS * step / max(np.sqrt(max(1.0 - nx * nx, 0.0)), STEEPEST)
        for axis in range(3):
            first[axis] = min(max(int((vertices[n, axis] - radius - low[axis]) / edge), 0), dims[axis])
            last[axis] = min(int((vertices[n, axis] + radius - low[axis]) / edge), dims[axis] - 1)
        for a in range(first[0], last[0] + 1):
            for b in range(first[1], last[1] + 1):
                row = (a * dims[1] + b) * dims[2]
                for at in range(start[row + first[2]], start[row + max(last[2] + 1, first[2])]):
                    near = order[at]
                    dx, dy, dz = places[near, 0] - x, places[near, 1] - y, places[near, 2] - z
                    squared = dx * dx + dy * dy + dz * dz
                    if squared >= radius * radius:
                        continue
                    height = dx * nx + dy * ny + dz * nz
                    squared += height * height * (1.0 / FLAT**2 - 1.0)
                    if squared >= radius * radius:
                        continue
                    k = camera[near]
                    # The camera stood beside the laser plane, and that in the point.
                    ahead, aside, above = (
                        centres[k, 0],
                        centres[k, 1] - places[near, 1],
                        centres[k, 2] - places[near, 2],
                    )
                    away = np.sqrt(ahead * ahead + aside * aside + above * above)
                    facing = (ahead * nx + aside * ny + above * nz) / away
                    if np.isnan(facing):
                        facing = UNKNOWN_VIEW
                    if facing <= GRAZING:
                        continue
                    weight = (1.0 - squared / (radius * radius)) ** 2 * (facing - GRAZING) ** 2
                    weight *= seen.trust[near]
                    into = k if apart else 0
                    for channel in range(3):
                        sums[n, into, channel] += weight * light[near, channel] * factors[k, channel]
                    sums[n, into, 3] += weight
    return sums


def _continued(light: Floats, known: NDArray[np.bool_], faces: NDArray[np.int32]) -> tuple[Floats, NDArray[np.bool_]]:
    """The light with that of other vertices set to the mean of their neighbours', and which vertices have light.

    These are the harmonic functions of the mesh as a graph, which lie between the values at their rims. Parts of the
    mesh with nothing known stay without.
    """
    edges = directed_edges(faces)
    directed = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), (len(light), len(light)))
    graph = csr_array(directed + directed.T)
    graph.data[:] = 1.0  # on either side of an edge there may be a face, or not
    _, part = connected_components(graph, directed=False)
    reached = np.bincount(part, known)[part] > 0
    free = np.flatnonzero(reached & ~known)
    if len(free):
        rows = csr_array(graph[free])
        laplacian = csc_array(diags_array(np.diff(rows.indptr).astype(np.float64)) - rows[:, free])
        light = light.copy()
        solve = splu(laplacian, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve
        light[free] = solve(np.asarray(rows[:, np.flatnonzero(known)] @ light[known], np.float64))
    return light, reached


def _inside_cut(vertices: Floats, faces: NDArray[np.int32], cut_mm: float) -> NDArray[np.bool_]:
    """(V,) which vertices lie on the cut with all that is around them: not its rim, which belongs to the skin."""
    inside = np.asarray(vertices[:, 2] == cut_mm)
    inside[faces[~faces_on_cut(vertices, faces, cut_mm)]] = False
    return inside
