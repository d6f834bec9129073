"""The filmed object: which point a ray meets, whether anything stands between two points, what lies near some X."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.virtual.optics.ranges import Ranges
from footscan.virtual.optics.ray_tree import any_hits, first_hits, ray_tree
from footscan.virtual.portable import cos_sin

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int64]

CREASE_DEGREES = 40.0
"""Faces that meet more sharply than this keep an edge; others are shaded as one smooth surface. Chosen by hand."""
PATCH_MM = 2.0
"""Longest edge of the triangles that `patches_near` returns: a bound of time. Chosen by hand."""
CLEARANCE_MM = 0.03
"""How far a shadow ray starts from its facet, which stands for a smooth surface: its neighbours do not shade it. Chosen
by hand."""


@dataclass(frozen=True)
class Surface:
    """How the object reflects light, diffusely."""

    albedo: tuple[float, float, float]
    """For red, green and blue room light."""
    laser_albedo: float
    halo: float
    """Share of laser light that comes out millimetres beside the line, scattered inside the object."""
    unevenness: float
    """Standard deviation of its colour from place to place."""


SKIN = Surface(albedo=(0.66, 0.43, 0.32), laser_albedo=0.62, halo=0.22, unevenness=0.05)
MATT_GREY = Surface(albedo=(0.5, 0.5, 0.5), laser_albedo=0.5, halo=0.015, unevenness=0.015)
"""The reflectances of both surfaces are chosen by hand."""


@dataclass(frozen=True)
class Mesh:
    """Triangles, counter-clockwise seen from outside."""

    vertices: Floats
    """(N, 3) mm, scanner frame."""
    faces: Ints
    """(M, 3) indices of vertices."""


@dataclass(frozen=True)
class Hits:
    """First hits of rays on the object; the arrays hold only rays that hit it."""

    ray: Ints
    """(H,) index of the ray."""
    distance: Floats
    """(H,) mm along the ray."""
    facet_normals: Floats
    """(H, 3) of the triangle."""
    normals: Floats
    """(H, 3) of the smooth surface that the triangles stand for."""


class Scene:
    """A triangle mesh made ready for casting rays at it."""

    def __init__(self, mesh: Mesh, surface: Surface) -> None:
        vertices, faces = mesh.vertices, mesh.faces
        self.surface = surface
        self._tree = ray_tree(vertices, faces)
        corners = vertices[faces]
        crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(crossed, axis=1, keepdims=True)
        self._facet_normals = crossed / np.maximum(area, 1e-30)
        self._corner_normals = _smooth_normals(faces, crossed, self._facet_normals, len(vertices))
        self._patches = _patches(corners, PATCH_MM)
        x = self._patches[:, :, 0]
        self._ranges = Ranges(np.stack([x.min(axis=1), x.max(axis=1)], axis=1))

    def cast(self, origins: Floats, directions: Floats) -> Hits:
        """First hits of rays, each array (N, 3)."""
        met, distance, shares = first_hits(np.ascontiguousarray(origins), np.ascontiguousarray(directions), self._tree)
        return Hits(*_hits(met, distance, shares, self._facet_normals, self._corner_normals))

    def hidden(self, points: Floats, facet_normals: Floats, ends: Floats) -> NDArray[np.bool_]:
        """Whether the object stands between surface points and `ends`, all (N, 3) mm; the surface faces its end."""
        starts = points + CLEARANCE_MM * facet_normals
        return np.asarray(any_hits(starts, ends - starts, 1.0 - 1e-4, self._tree))

    def patches_near(self, x: float, reach: float) -> Floats:
        """Corners, (K, 3, 3), of small triangles that cover all of the surface within `reach` mm of X = x."""
        return np.asarray(self._patches[self._ranges.within(x - reach, x + reach)])


def _smooth_normals(faces: Ints, crossed: Floats, facet_normals: Floats, vertices: int) -> Floats:
    """A normal for each corner of each face, (M, 3, 3): the mean of the faces around it on this side of any crease."""
    around = np.argsort(faces.ravel(), kind="stable")
    starts = np.searchsorted(faces.ravel()[around], np.arange(vertices + 1))
    return np.asarray(_mean_normals(faces, crossed, facet_normals, around // 3, starts, cos_sin(CREASE_DEGREES)[0]))


@compiled
def _mean_normals(
    faces: Ints, crossed: Floats, facet_normals: Floats, around: Ints, starts: Ints, least_cosine: float
) -> Floats:
    normals = np.empty((len(faces), 3, 3))
    for face in range(len(faces)):
        for corner in range(3):
            x = y = z = 0.0
            vertex = faces[face, corner]
            for k in range(starts[vertex], starts[vertex + 1]):
                other = around[k]
                if (
                    facet_normals[face, 0] * facet_normals[other, 0]
                    + facet_normals[face, 1] * facet_normals[other, 1]
                    + facet_normals[face, 2] * facet_normals[other, 2]
                ) >= least_cosine:
                    x, y, z = x + crossed[other, 0], y + crossed[other, 1], z + crossed[other, 2]
            length = np.sqrt(x * x + y * y + z * z)
            for axis, part in enumerate((x, y, z)):
                normals[face, corner, axis] = part / length if length > 0.0 else facet_normals[face, axis]
    return normals


@compiled
def _hits(
    met: Ints, distance: Floats, shares: Floats, facet_normals: Floats, corner_normals: Floats
) -> tuple[Ints, Floats, Floats, Floats]:
    """The fields of `Hits`, of rays that met triangles `met` (N,) as `first_hits` says; -1 where there is none."""
    count = 0
    for face in met:
        count += face >= 0
    ray, distances = np.empty(count, np.int64), np.empty(count)
    facets, normals = np.empty((count, 3)), np.empty((count, 3))
    n = 0
    for k in range(len(met)):
        face = met[k]
        if face < 0:
            continue
        ray[n], distances[n] = k, distance[k]
        u, v = shares[k]
        squares = 0.0
        for axis in range(3):
            facets[n, axis] = facet_normals[face, axis]
            normals[n, axis] = (
                corner_normals[face, 0, axis] * (1.0 - u - v)
                + corner_normals[face, 1, axis] * u
                + corner_normals[face, 2, axis] * v
            )
            squares += normals[n, axis] * normals[n, axis]
        length = max(np.sqrt(squares), 1e-12)
        for axis in range(3):
            normals[n, axis] /= length
        n += 1
    return ray, distances, facets, normals


def _patches(corners: Floats, longest: float) -> Floats:
    """Triangles (K, 3, 3) that cover those of `corners`, with no edge above `longest` mm: longest edges are halved."""
    done = []
    while len(corners):
        edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        edge = edges.argmax(axis=1)
        long = edges.max(axis=1) > longest
        done.append(corners[~long])
        rows, edge = np.arange(len(corners))[long], edge[long]
        a, b, c = (corners[rows, (edge + k) % 3] for k in range(3))
        middle = (a + b) / 2.0
        corners = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(done)
