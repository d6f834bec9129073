"""A rough closed surface: the level of a function that is 1 inside and 0 outside.

The smoothed gradient of that function is the sum of the points' normals, each times the area that the point stands
for. So the function solves a Poisson equation (Kazhdan, Bolitho and Hoppe 2006, doi:10.2312/SGP/SGP06/061-070), here on
an even grid, where cosine transforms solve it directly. The level surface also closes what no camera saw. Its distance
from the points matters little, since `projection` moves it onto them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage
from skimage.measure import marching_cubes

from footscan.compiled import compiled
from footscan.mesh.buckets import sort_into_cubes
from footscan.mesh.topology import largest_component, used_vertices
from footscan.rows import limits
from schemas.base.errors import Finding

MARGIN_BLURS = 8.0
"""Margin of the grid around the points, in blurs, in which the function falls to its value outside; chosen by hand."""
MAX_CELLS = 12_000_000
"""Bound of memory, at 100 bytes a cell: a grid with more cells is made coarser."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Indicator:
    """Values of the function at the points low + spacing * (a, b, c) of a grid."""

    values: NDArray[np.float32]
    low: Floats
    """(3,) mm"""
    spacing: float
    """mm"""
    level: float
    """Value of the function on the surface."""


def indicator(points: Floats, normals: Floats, spacing: float, blur: float) -> Indicator:
    """Compute the indicator function of a cloud.

    Parameters
    ----------
    points : (N, 3) float64, mm
    normals : (N, 3) unit vectors, outward
    spacing : mm, of the grid
    blur : mm, standard deviation of the Gaussian that smooths the normals; about the distance of neighbouring points
    """
    low, high = limits(points)
    low, high = low - MARGIN_BLURS * blur, high + MARGIN_BLURS * blur
    while np.prod((high - low) / spacing + 1) > MAX_CELLS:
        spacing *= 1.1
    shape = tuple(fft.next_fast_len(int(n), real=True) for n in np.ceil((high - low) / spacing) + 1)
    flow = np.zeros((3, *shape), np.float32)
    _spread(flow, (points - low) / spacing, -normals * areas(points, blur)[:, None])
    divergence = np.zeros(shape, np.float32)
    for axis in range(3):
        divergence += np.gradient(flow[axis], axis=axis)
    wave = [(np.pi * np.arange(n) / n).astype(np.float32) for n in shape]
    spectrum = fft.dctn(divergence, type=2, workers=-1, overwrite_x=True)
    for axis, k in enumerate(wave):
        spectrum *= np.expand_dims(np.exp(-0.5 * (blur / spacing * k) ** 2), [n for n in range(3) if n != axis])
    x, y, z = (2.0 - 2.0 * np.cos(k) for k in wave)
    laplacian = x[:, None, None] + y[None, :, None] + z[None, None, :]
    laplacian[0, 0, 0] = 1.0
    spectrum /= -laplacian
    spectrum[0, 0, 0] = 0.0  # any constant would do
    values = fft.idctn(spectrum, type=2, workers=-1, overwrite_x=True)
    at_points = ndimage.map_coordinates(values, ((points - low) / spacing).T, order=1)
    return Indicator(values, low, spacing, float(np.median(at_points)))


def level_surface(field: Indicator, x_mm: tuple[float, float]) -> tuple[Floats, NDArray[np.int32]]:
    """Extract the closed level surface of largest extent.

    Parameters
    ----------
    x_mm : least and greatest X of the surface, which is cut off flat there

    Returns
    -------
    vertices : (V, 3) float64, mm
    faces : (F, 3) int32, counter-clockwise seen from outside

    Raises
    ------
    Finding
        No surface runs through the points.
    """
    values = field.values.copy()
    x = field.low[0] + field.spacing * np.arange(len(values))
    within = np.minimum(x - x_mm[0], x_mm[1] - x) / field.spacing * (values.max() - field.level)
    np.minimum(values, field.level + within.astype(np.float32)[:, None, None], out=values)
    for axis in range(3):  # the function is least at the border, so the surface is closed
        np.moveaxis(values, axis, 0)[[0, -1]] = values.min()
    if not values.min() < field.level < values.max():
        raise Finding("no surface through the points, expected normals that point outward")
    vertices, faces, _, _ = marching_cubes(values, field.level, allow_degenerate=False)
    faces = np.ascontiguousarray(faces[:, ::-1], np.int32)  # marching cubes orders corners clockwise seen from outside
    corners, faces = used_vertices(vertices.astype(np.float64), largest_component(faces))
    return field.low + field.spacing * corners, faces


def areas(points: Floats, radius: float) -> Floats:
    """Returns (N,) areas in mm² of the surface that each of (N, 3) `points` stands for, from the density around it.

    Examples
    --------
    Points of a plane, 1 mm apart; the one in the middle stands for 1 mm²:

    >>> x, y = np.meshgrid(np.arange(21.0), np.arange(21.0))
    >>> plane = np.column_stack([x.ravel(), y.ravel(), np.zeros(441)])
    >>> float(areas(plane, radius=2.0)[220].round(1))
    1.0
    """
    buckets = sort_into_cubes(points, 2 * radius)
    return 1.0 / _densities(points, radius, buckets.edge, buckets.low, buckets.dims, buckets.start, buckets.order)


@compiled
def _densities(
    points: Floats,
    radius: float,
    edge: float,
    low: Floats,
    dims: NDArray[np.int64],
    start: NDArray[np.int64],
    order: NDArray[np.int64],
) -> Floats:
    """Returns (N,) points per mm², weighted by a Gaussian that is cut off at two standard deviations."""
    density = np.zeros(len(points))
    whole = 2.0 * np.pi * radius * radius * (1.0 - np.exp(-2.0))
    for n in range(len(points)):
        first, last = np.empty(3, np.int64), np.empty(3, np.int64)
        for axis in range(3):
            cube = int((points[n, axis] - low[axis]) / edge)
            first[axis], last[axis] = max(cube - 1, 0), min(cube + 1, dims[axis] - 1)
        weights = 0.0
        for a in range(first[0], last[0] + 1):
            for b in range(first[1], last[1] + 1):
                row = (a * dims[1] + b) * dims[2]
                for at in range(start[row + first[2]], start[row + last[2] + 1]):
                    near = order[at]
                    squared = 0.0
                    for axis in range(3):
                        squared += (points[near, axis] - points[n, axis]) ** 2
                    if squared < 4.0 * radius * radius:
                        weights += np.exp(-0.5 * squared / (radius * radius))
        density[n] = weights / whole
    return density


@compiled
def _spread(grid: NDArray[np.float32], places: Floats, vectors: Floats) -> None:
    """Add each vector to the eight grid points around its place, with trilinear weights."""
    for n in range(len(places)):
        a, b, c = int(places[n, 0]), int(places[n, 1]), int(places[n, 2])
        u, v, w = places[n, 0] - a, places[n, 1] - b, places[n, 2] - c
        for corner in range(8):
            i, j, k = corner & 1, (corner >> 1) & 1, corner >> 2
            share = (u if i else 1.0 - u) * (v if j else 1.0 - v) * (w if k else 1.0 - w)
            for axis in range(3):
                grid[axis, a + i, b + j, c + k] += np.float32(share * vectors[n, axis])
