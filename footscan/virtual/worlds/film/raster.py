"""Which point of a mesh each pixel of a picture shows, by scan conversion into a depth buffer.

A ray for each pixel is exact, but costs ten times as much: the projected vertices of a mesh of 2 mm are 8 px apart, and
a triangle that small is a plane in the picture as well, also behind a plate that refracts.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.virtual.optics.scanner import Camera
from footscan.virtual.portable import dot

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NOTHING = -1
EDGE_PX = 1e-9
"""Slack of a triangle's edges: no pixel is lost between two triangles."""


class Raster(NamedTuple):
    """What the pixels of a picture show; rows by columns."""

    face: NDArray[np.int32]
    """(R, C) the triangle, -1 beside the mesh."""
    shares: NDArray[np.float32]
    """(R, C, 2) shares of its second and third corner in the point."""


class Projected(NamedTuple):
    """Vertices in a picture."""

    pixels: Floats
    """(V, 2) columns and rows; NaN behind the camera."""
    depth: Floats
    """(V,) mm along the optical axis."""


def project(vertices: Floats, camera: Camera, passes: int = 1) -> Projected:
    """Project vertices (V, 3), plate frame, with refraction for a camera below the plate."""
    return Projected(camera.project(vertices, passes), dot(vertices - camera.position, camera.rotation[2]))


def rasterise(projected: Projected, faces: Ints, shape: tuple[int, int], *, mirrored: bool = False) -> Raster:
    """Find the nearest triangle that faces the camera at each pixel.

    faces : (M, 3), counter-clockwise seen from outside. mirrored : for an image in a mirror, which turns that round.
    """
    face = np.full(shape, NOTHING, np.int32)
    shares = np.zeros((*shape, 2), np.float32)
    depth = np.full(shape, np.inf)
    _fill(projected.pixels, projected.depth, faces, mirrored, face, shares, depth)
    return Raster(face, shares)


@compiled
def _fill(
    pixels: Floats,
    distance: Floats,
    faces: Ints,
    mirrored: bool,
    face: NDArray[np.int32],
    shares: NDArray[np.float32],
    depth: Floats,
) -> None:
    rows, columns = face.shape
    for m in range(len(faces)):
        a, b, c = faces[m, 0], faces[m, 1], faces[m, 2]
        ai, aj, bi, bj = pixels[a, 0], pixels[a, 1], pixels[b, 0], pixels[b, 1]
        ci, cj = pixels[c, 0], pixels[c, 1]
        # Twice the signed area; rows grow downwards, so a face that looks at the camera runs clockwise.
        area = (bi - ai) * (cj - aj) - (ci - ai) * (bj - aj)
        if mirrored:
            area = -area
        if not area < 0.0:  # NaN behind the camera
            continue
        if mirrored:
            area = -area
        least_i, most_i = max(np.ceil(min(ai, bi, ci)), 0.0), min(np.floor(max(ai, bi, ci)), columns - 1.0)
        least_j, most_j = max(np.ceil(min(aj, bj, cj)), 0.0), min(np.floor(max(aj, bj, cj)), rows - 1.0)
        for j in range(int(least_j), int(most_j) + 1):
            for i in range(int(least_i), int(most_i) + 1):
                u = ((i - ai) * (cj - aj) - (ci - ai) * (j - aj)) / area
                v = ((bi - ai) * (j - aj) - (i - ai) * (bj - aj)) / area
                if u < -EDGE_PX or v < -EDGE_PX or u + v > 1.0 + EDGE_PX:
                    continue
                # Shares on the triangle, not in the picture: what is farther away is shown smaller.
                u, v, w = u / distance[b], v / distance[c], (1.0 - u - v) / distance[a]
                z = 1.0 / (u + v + w)
                u, v = u * z, v * z
                if z < depth[j, i]:
                    depth[j, i] = z
                    face[j, i] = m
                    shares[j, i, 0], shares[j, i, 1] = u, v
