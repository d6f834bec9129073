"""Colours of the vertices of a surface, from the colours of the stripe points around them."""

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
"""Grey levels (0 to 255) where no colour was measured: on the flat cut of the ankle."""
LIGHTEST, LIGHTEST_QUANTILE = 0.8, 0.99
"""One exposure for the whole surface brings this quantile of the light to this level of white; chosen by hand."""
NIGHT = 0.01
"""Least light that the exposure assumes for that quantile: a darker surface is noise. Chosen by hand."""
REACH_STEPS = 1.25
"""Radius along the surface of the points that colour a vertex, in distances from stripe to stripe: one stripe at least,
usually two."""
LEAST_REACH_MM = 1.5
"""Least such radius; chosen by hand."""
STEEPEST = 0.25
"""Sine of the least angle between surface and stripe planes by which that radius grows; chosen by hand."""
FLAT = 0.4
"""Height of the lens along the surface in which points are sought, as a share of its width; chosen by hand."""
GRAZING = 0.1
"""Cosine between view and normal at which a camera's weight falls to zero; chosen by hand."""
UNKNOWN_VIEW = 0.5
"""Cosine assumed for a camera whose place is unknown; chosen by hand."""
COMPARED = 6000
"""Bound of time: about this many vertices are used to compare the brightness of the cameras."""


class _Samples(NamedTuple):
    """Points with colours, as the compiled loops read them."""

    places: Floats
    """(N, 3) mm"""
    light: Floats
    """(N, 3) linear light"""
    trust: Floats
    """(N,) factors of the weights"""
    camera: Ints
    """(N,) index into `centres`"""
    centres: Floats
    """(C, 3) mm, camera centres, X counted from the laser plane; NaN where unknown"""


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
    """Compute the sRGB colours of the vertices: (V, 3) red, green and blue, 0 to 255.

    A vertex takes the weighted mean of the points around it on its side of the surface. The weights fall with the
    distance and with the angle between the camera's view and the normal. Brightness and white balance of the cameras
    are equalised first, by one gain for each camera and channel, where the cameras see the same skin. Filled vertices
    and vertices without points continue the colours around them smoothly: each is the mean of its neighbours. Finally
    one exposure is applied to all. Shades stay: the colours are those of the skin in the light of the room.

    Parameters
    ----------
    vertices : (V, 3) float64, mm, scanner frame
    normals : (V, 3) outward unit vectors
    faces : (F, 3) int32
    filled : (V,) true for vertices that were not measured
    points : (N,) array of `POINT_DTYPE`, mm, scanner frame: the points of all cameras, before fusion, that have
        a colour
    colours : (N, 3) of the points, in linear light, 1 is white; see `point_colours`
    centres : by camera, (3,) mm, in the frame of the heads (X counts from the laser plane), where the place is known
    cut_mm : Z of the flat cut of the ankle. The inside of the cut is grey; so is the whole mesh without colours
    """
    light = np.full((len(vertices), 3), np.nan)
    measured = np.flatnonzero(~filled)
    finite = np.isfinite(coordinates(points)).all(axis=1)
    points, colours = points[finite], colours[finite]
    step = max(stripe_step(points), LEAST_REACH_MM / REACH_STEPS)
    samples = _samples_near(vertices[measured], points, colours, centres, step)
    if len(samples.places):
        light[measured] = _mean_light(vertices[measured], normals[measured], samples, step)
    has_light = np.isfinite(light[:, 0])
    light, reached = _continued(light, has_light, faces)
    levels = np.full((len(vertices), 3), NEUTRAL, np.uint8)
    if np.any(has_light):
        exposure = LIGHTEST / max(np.quantile(light[has_light].max(axis=1), LIGHTEST_QUANTILE), NIGHT)
        levels[reached] = np.rint(255 * as_level(np.clip(exposure * light[reached], 0.0, 1.0)))
    if cut_mm is not None:
        levels[_inside_cut(vertices, faces, cut_mm) & filled] = NEUTRAL
    return levels


def _samples_near(
    vertices: Floats,
    points: NDArray[np.void],
    colours: NDArray[np.float32],
    centres: Mapping[int, Floats],
    step: float,
) -> _Samples:
    """Returns the points that lie in the box around the vertices, with their colours and cameras."""
    places = coordinates(points)
    margin = REACH_STEPS * step / STEEPEST
    low, high = vertices.min(axis=0, initial=np.inf) - margin, vertices.max(axis=0, initial=-np.inf) + margin
    inside = ((places >= low) & (places <= high)).all(axis=1)
    cameras, camera = np.unique(points["camera"][inside], return_inverse=True)
    unknown = np.full(3, np.nan)
    camera_centres = np.array([centres.get(int(number), unknown) for number in cameras]).reshape(-1, 3)
    light = colours[inside].astype(np.float64)
    trust = np.where(is_clipped(light), CLIPPED_WEIGHT, 1.0)
    return _Samples(places[inside], light, trust, camera.astype(np.int64), camera_centres)


def _mean_light(vertices: Floats, normals: Floats, samples: _Samples, step: float) -> Floats:
    """Returns (V, 3) light of the vertices; NaN where there is no point around a vertex."""
    buckets = sort_into_cubes(samples.places, REACH_STEPS * step)
    compared = np.arange(0, len(vertices), max(len(vertices) // COMPARED, 1))
    no_gains = np.zeros((len(samples.centres), 3))
    sums = _sum_up(vertices[compared], normals[compared], samples, no_gains, True, step, buckets)
    gains = camera_gains(sums)
    light = _sum_up(vertices, normals, samples, gains, False, step, buckets)[:, 0]
    weight = light[:, 3:]
    means: Floats = np.divide(light[:, :3], weight, out=np.full_like(light[:, :3], np.nan), where=weight > 0)
    return means


@compiled
def _sum_up(
    vertices: Floats,
    normals: Floats,
    samples: _Samples,
    gains: Floats,
    by_camera: bool,
    step: float,
    buckets: Buckets,
) -> Floats:
    """Returns (V, C or 1, 4) weighted light of the points around each vertex and its weight, by camera or of all."""
    places, light, camera, centres = samples.places, samples.light, samples.camera, samples.centres
    edge, low, dims, start, order = buckets.edge, buckets.low, buckets.dims, buckets.start, buckets.order
    factors = np.exp(-gains)
    sums = np.zeros((len(vertices), len(centres) if by_camera else 1, 4))
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
                    # When this point was filmed, the laser plane passed through it; centres count X from that plane.
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
                    weight *= samples.trust[near]
                    into = k if by_camera else 0
                    for channel in range(3):
                        sums[n, into, channel] += weight * light[near, channel] * factors[k, channel]
                    sums[n, into, 3] += weight
    return sums


def _continued(
    light: Floats, has_light: NDArray[np.bool_], faces: NDArray[np.int32]
) -> tuple[Floats, NDArray[np.bool_]]:
    """Set the light of the other vertices to the mean of their neighbours; returns the light and (V,) who has light.

    The result is harmonic on the graph of the mesh, so it lies between the values at the rims. Parts of the mesh
    without any light stay without.
    """
    edges = directed_edges(faces)
    directed = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), (len(light), len(light)))
    graph = csr_array(directed + directed.T)
    graph.data[:] = 1.0  # an edge has one face or two
    _, part = connected_components(graph, directed=False)
    reached = np.bincount(part, has_light)[part] > 0
    free = np.flatnonzero(reached & ~has_light)
    if len(free):
        rows = csr_array(graph[free])
        laplacian = csc_array(diags_array(np.diff(rows.indptr).astype(np.float64)) - rows[:, free])
        light = light.copy()
        solve = splu(laplacian, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve
        light[free] = solve(np.asarray(rows[:, np.flatnonzero(has_light)] @ light[has_light], np.float64))
    return light, reached


def _inside_cut(vertices: Floats, faces: NDArray[np.int32], cut_mm: float) -> NDArray[np.bool_]:
    """Returns (V,) which vertices lie on the cut with all faces around them: the rim belongs to the skin."""
    inside = np.asarray(vertices[:, 2] == cut_mm)
    inside[faces[~faces_on_cut(vertices, faces, cut_mm)]] = False
    return inside
