"""The exact stripe, in mm and in pixels: the lit and visible part of the object's cut by the laser plane."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from footscan.virtual.filming.renderers import Shot
from footscan.virtual.optics.glass import directions_from_below, exits_above
from footscan.virtual.optics.laser_light import laser_light
from footscan.virtual.optics.scanner import HEIGHT, WIDTH, Camera, VirtualScanner, standard_scanner
from footscan.virtual.optics.scene import Hits, Mesh, Scene, Surface
from schemas.parameters.simulation import SimulationSettings

Floats = NDArray[np.float64]

SPACING_MM = 0.25
"""Largest distance of points along the cut. Chosen by hand."""
LEAST_LIGHT = 0.01
"""Dimmest laser light that counts as lit, in units of the sensor's white. Chosen by hand."""
GRAZING = 0.02
"""Least cosine between sight and normal of a surface that counts as seen. Chosen by hand."""


def write_stripe_truth(
    mesh: Mesh, surface: Surface, shots: list[Shot], folder: Path, settings: SimulationSettings
) -> None:
    """Write `cam<n>.csv` for each camera: frame,i,j,x_mm,y_mm,z_mm of points on the exact stripe."""
    folder.mkdir(parents=True, exist_ok=True)
    scanner = standard_scanner(settings.scanner_seed, settings.distortion)
    scene = Scene(mesh, surface)
    rows: dict[int, list[str]] = {camera.id: [] for camera in scanner.cameras}
    for shot in shots:
        points, normals = section(mesh, shot.x)
        lit = is_lit(scene, scanner, shot.x, points, normals, settings)
        points, normals = points[lit], normals[lit]
        for camera in scanner.cameras:
            seen = points[is_seen(scene, camera, shot.x, points, normals)]
            for (i, j), (_, y, z) in zip(camera.project(seen), seen, strict=True):
                rows[camera.id].append(f"{shot.frame},{i:.4f},{j:.4f},{shot.x:.4f},{y:.4f},{z:.4f}\n")
    for camera_id, lines in rows.items():
        (folder / f"cam{camera_id}.csv").write_text("frame,i,j,x_mm,y_mm,z_mm\n" + "".join(lines), encoding="utf-8")


def section(mesh: Mesh, x: float) -> tuple[Floats, Floats]:
    """Returns points (N, 3), mm, frame of the heads, along the mesh's cut at X = `x`, and the normals (N, 3) there."""
    corners = mesh.vertices[mesh.faces] - np.array([x, 0.0, 0.0])
    corners = corners[(corners[:, :, 0].min(axis=1) <= 0.0) & (corners[:, :, 0].max(axis=1) > 0.0)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    ends = []
    for k in range(3):  # the edge opposite the corner that lies alone on its side of the plane is not cut
        a, b, c = (corners[:, (k + n) % 3] for n in range(3))
        alone = ((a[:, 0] > 0.0) != (b[:, 0] > 0.0)) & ((a[:, 0] > 0.0) != (c[:, 0] > 0.0))
        a, b, c = a[alone], b[alone], c[alone]
        to_b = a + (a[:, :1] / (a[:, :1] - b[:, :1])) * (b - a)
        to_c = a + (a[:, :1] / (a[:, :1] - c[:, :1])) * (c - a)
        ends.append((to_b, to_c, normals[alone]))
    starts, stops, sides = (np.concatenate(parts) for parts in zip(*ends, strict=True))
    counts = np.ceil(np.linalg.norm(stops - starts, axis=1) / SPACING_MM).astype(np.int64)
    segment = np.repeat(np.arange(len(counts)), counts)
    within = np.arange(len(segment)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = ((within + 0.5) / np.maximum(counts[segment], 1))[:, None]
    points = starts[segment] * (1.0 - share) + stops[segment] * share
    points[:, 0] = 0.0
    return points, sides[segment]


def is_lit(
    scene: Scene, scanner: VirtualScanner, x: float, points: Floats, normals: Floats, settings: SimulationSettings
) -> NDArray[np.bool_]:
    """Returns (N,) bool: True if a laser reaches a surface point.

    points, normals : (N, 3) float64, on the laser plane, mm, frame of the heads.
    """
    hits = Hits(np.arange(len(points)), np.zeros(len(points)), normals, normals)
    light = laser_light(scene, x, scanner.lasers, points, hits, np.zeros(len(points)), settings)
    return np.asarray(light * scene.surface.laser_albedo > LEAST_LIGHT)


def is_seen(scene: Scene, camera: Camera, x: float, points: Floats, normals: Floats) -> NDArray[np.bool_]:
    """Returns (N,) bool: True if `camera` sees a surface point within its picture.

    points, normals : (N, 3) float64, mm, frame of the heads.
    """
    if camera.below_glass:
        directions = directions_from_below(camera.position, points, thickness=camera.plate_mm)
        eyes, towards = exits_above(camera.position, directions, thickness=camera.plate_mm), -directions
    else:
        eyes = np.broadcast_to(camera.position, points.shape)
        towards = (eyes - points) / np.linalg.norm(eyes - points, axis=1, keepdims=True)
    centre, size = np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2]), np.array([WIDTH, HEIGHT])
    inside = (np.abs(camera.project(points) - centre) <= size / 2).all(axis=1)
    seen = inside & (np.einsum("ij,ij->i", normals, towards) > GRAZING)
    travel = np.array([x, 0.0, 0.0])
    seen[seen] = ~scene.hidden(points[seen] + travel, normals[seen], eyes[seen] + travel)
    return np.asarray(seen)
