"""Distances of one shape to another."""

import numpy as np
from numpy.typing import NDArray

from footscan.surface.export import Shape
from footscan.surface.sampling import sample_surface
from schemas.errors import RefusedInput
from schemas.quality import Comparison

SAMPLES = 200_000
BLOCK = 100_000
"""Points a query; it bounds the memory."""
RAYS = 5
"""Rays a point that vote on whether it lies inside."""


def compare(a: Shape, b: Shape) -> Comparison:
    """How far the surface of `a`, or its points where it is a cloud, lies from the surface of `b`, a mesh; mm."""
    vertices, faces = a
    points = sample_surface(vertices, faces, SAMPLES) if len(faces) else vertices
    signed = signed_distances(points, b)
    unsigned = np.abs(signed)
    p50, p90, p95, p99 = np.percentile(unsigned, [50, 90, 95, 99]).tolist()
    return Comparison(
        mean=float(unsigned.mean()),
        std=float(unsigned.std()),
        min=float(unsigned.min()),
        max=float(unsigned.max()),
        p50=p50,
        p90=p90,
        p95=p95,
        p99=p99,
        rms=float(np.sqrt(np.mean(unsigned**2))),
        signed_mean=float(signed.mean()),
    )


def distances(points: NDArray[np.floating], mesh: Shape) -> NDArray[np.float64]:
    """(N,) distance in mm of each of (N, 3) `points` to the nearest place of `mesh`."""
    return np.abs(signed_distances(points, mesh))


def signed_distances(points: NDArray[np.floating], mesh: Shape) -> NDArray[np.float64]:
    """(N,) distance in mm of each of (N, 3) `points` to the nearest place of `mesh`, negative inside.

    Inside is where most rays cross the mesh an odd number of times; what that means for a mesh with large holes depends
    on the point.
    """
    import open3d as o3d

    vertices, faces = mesh
    if not len(faces) or not len(points):
        raise RefusedInput(
            "reference" if len(points) else "shape", "is empty, expected points and a mesh with triangles"
        )
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2  # the scene counts in float32: 0.01 um near its origin
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor.from_numpy((vertices - centre).astype(np.float32)),
        o3d.core.Tensor.from_numpy(faces.astype(np.uint32)),
    )
    centred = (np.asarray(points, np.float64) - centre).astype(np.float32)
    blocks = [
        scene.compute_signed_distance(o3d.core.Tensor.from_numpy(centred[start : start + BLOCK]), nsamples=RAYS).numpy()
        for start in range(0, len(centred), BLOCK)
    ]
    return np.concatenate(blocks).astype(np.float64)
