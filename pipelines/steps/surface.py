"""Cloud with normals to a triangle mesh."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.cloud.points import coordinates, stripe_step
from footscan.mesh.topology import vertex_normals
from footscan.surface.ball_pivoting import mesh_cloud, nearest_points
from footscan.surface.closed_surface import close_surface
from pipelines.arrays import pack, unpack
from schemas.parameters.surface import SurfaceParameters


def run(inputs: Mapping[str, bytes], parameters: SurfaceParameters, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `oriented`."""
    del places
    oriented = unpack(inputs["oriented"])
    cloud, normals = oriented["cloud"], oriented["normals"]
    points, step_mm = coordinates(cloud), stripe_step(cloud)
    if parameters.method == "ball_pivoting":
        vertices, faces = mesh_cloud(points, normals, step_mm, parameters)
        filled, nearest = nearest_points(vertices, points, parameters.gap_steps * step_mm)
        camera = np.where(filled, 0, cloud["camera"][nearest]).astype(np.uint8)
        return pack(
            vertices=vertices, faces=faces, normals=vertex_normals(vertices, faces), camera=camera, filled=filled
        )
    mesh = close_surface(points, normals, cloud["camera"], step_mm, parameters)
    known = {"normals": mesh.normals, "camera": mesh.camera, "filled": mesh.filled}
    cut = {"cut_mm": np.array(float(mesh.metadata["cut_mm"]))} if "cut_mm" in mesh.metadata else {}
    given = {name: values for name, values in known.items() if values is not None}
    return pack(vertices=mesh.vertices, faces=mesh.faces, **given, **cut)
