"""Small things that catch or keep light: hairs and nails of a foot, marks on the glass that a laser sheet crosses.

Places are in the plate frame, mm.
"""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.virtual.optics.scanner import Camera
from footscan.virtual.optics.scene import Mesh
from footscan.virtual.worlds.film.raster import NOTHING, Raster
from footscan.virtual.worlds.film.scenery import Mark, dim_rod, draw_rod
from footscan.virtual.worlds.machine import Pose
from schemas.world import World

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

HAIR_RADIUS_MM = 0.04
"""Hairs of a leg are 0.06 to 0.1 mm thick."""
HAIR_LENGTH_MM = (5.0, 25.0)
HAIRLESS_MM = 30.0
"""Height up to which a foot has no hairs, about: sole and edges. Chosen by hand."""
HAIR_RISE = 0.3
"""Rise of a hair from the skin as a share of its length. Chosen by hand."""
HAIR_DARKNESS = 0.8
"""Share of the light that a hair keeps from the camera."""
HAIR_LIGHT = 0.3
"""Light of a hair in the laser, relative to a white surface. Chosen by hand."""
NEAR_SKIN_MM = 5.0
"""A hair is seen where the skin that is seen at its root is nearer than this."""
NAIL_UP = 0.4
"""A nail faces upwards at least so much. Chosen by hand."""
SHININESS = 60.0
"""Exponent of the highlight of a nail (B. Phong 1975). Chosen by hand."""
MARK_LIGHT = 0.2
"""Light that a mark on the glass scatters out of the sheet, relative to white. Chosen by hand."""


def hairs_of(mesh: Mesh, normals: Floats, world: World) -> Floats:
    """Draw the hairs of a foot at random, but fixed for the world: (H, 2, 3) their roots and ends."""
    random = np.random.default_rng([world.seed, 640])
    count = world.subject.hairs
    hairy = np.flatnonzero(mesh.vertices[:, 2] > HAIRLESS_MM)
    if not count or not len(hairy):
        return np.empty((0, 2, 3))
    chosen = random.choice(hairy, size=count)
    roots, up = mesh.vertices[chosen], normals[chosen]
    along = random.normal((0.0, 0.0, -1.0), 1.0, (count, 3))
    along -= np.einsum("ij,ij->i", along, up)[:, None] * up
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    length = random.uniform(*HAIR_LENGTH_MM, (count, 1))
    return np.stack([roots, roots + length * (along + HAIR_RISE * up)], axis=1)


def draw_hairs(hairs: Floats, camera: Camera, light: Singles) -> None:
    """Draw hairs (H, 2, 3) in front of the skin into a picture of light (R, C, 3)."""
    for ends in hairs:
        pixels = camera.project(ends)
        if np.isfinite(pixels).all():
            away = float(np.linalg.norm(ends[0] - camera.position))
            breadth_px = 2.0 * HAIR_RADIUS_MM * camera.lens.focal_px / away
            dim_rod(pixels, max(0.5 * breadth_px, 0.5), np.float32(HAIR_DARKNESS * min(breadth_px, 1.0)), light)


def visible(hairs: Floats, camera: Camera, shown: tuple[Raster, Floats]) -> NDArray[np.bool_]:
    """Return (H,) true for hairs whose roots the camera sees.

    shown : what the pixels show, and the middles (M, 3) of the mesh's faces.
    """
    raster, centres = shown
    rows, columns = raster.face.shape
    if not len(hairs):
        return np.zeros(0, np.bool_)
    pixels = np.nan_to_num(camera.project(hairs[:, 0]), nan=-1.0)
    i, j = np.rint(np.clip(pixels, -1.0, 1e6)).astype(np.int64).T
    inside = (i >= 0) & (i < columns) & (j >= 0) & (j < rows)
    seen = np.zeros(len(hairs), np.bool_)
    face = raster.face[j[inside], i[inside]]
    away = np.linalg.norm(centres[face] - hairs[inside, 0], axis=1)
    seen[inside] = (face != NOTHING) & (away < NEAR_SKIN_MM)
    return seen


def lit_hairs(hairs: Floats, pose: Pose, camera: Camera, brightness: float, into: Singles) -> None:
    """Add to a picture (R, C, 1) the light of hairs where the laser sheet of a head at `pose` crosses them.

    brightness : of a white surface in the sheet.
    """
    for root, end in hairs:
        first, last = pose.undo(np.array([root, end]))[:, 0]
        if first * last < 0.0:
            place = root + first / (first - last) * (end - root)
            pixels = camera.project(place[None])
            if np.isfinite(pixels).all():
                spot = np.array([brightness * HAIR_LIGHT * HAIR_RADIUS_MM], np.float32)
                draw_rod(np.repeat(pixels, 2, axis=0), 0.7, spot, True, into)


def sparkle(marks: list[Mark], pose: Pose, camera: Camera, brightness: float, hidden: Raster, into: Singles) -> None:
    """Add to a picture (R, C, 1) what marks on the glass scatter where the sheet of a head at `pose` crosses them.

    brightness : of a white surface in the sheet. hidden : the subject hides marks from cameras above.
    """
    for mark in marks:
        first, last = pose.undo(mark.ends)[:, 0]
        share = min(max(first / (first - last), 0.0), 1.0) if first != last else 0.0
        off = first + share * (last - first)
        if abs(off) >= mark.radius_mm:
            continue
        on_axis = mark.ends[0] + share * (mark.ends[1] - mark.ends[0])
        place = on_axis - np.array([off, 0.0, 0.0])  # a chord of the mark, in the sheet
        half = np.array([0.0, np.sqrt(mark.radius_mm**2 - off**2), 0.0])
        pixels = camera.project(np.array([place - half, place + half]))
        if np.isfinite(pixels).all() and (camera.below_glass or not _is_hidden(pixels, hidden)):
            light = np.array([brightness * MARK_LIGHT * mark.opacity], np.float32)
            draw_rod(pixels, 0.7, light, True, into)


def _is_hidden(pixels: Floats, raster: Raster) -> bool:
    rows, columns = raster.face.shape
    i, j = np.rint(pixels.mean(axis=0)).astype(np.int64)
    return bool(0 <= i < columns and 0 <= j < rows and raster.face[j, i] != NOTHING)


@compiled
def highlight(points: Floats, normals: Floats, towards: Floats, sight: Floats, nails: Floats) -> Floats:
    """Return (N,) the highlight of a light on nails; 0 beside them.

    points, normals, towards, sight : (N, 3), the last two unit vectors to the light and to the camera. nails : (K, 4)
    centre and radius.
    """
    shine = np.zeros(len(points))
    for n in range(len(points)):
        if normals[n, 2] < NAIL_UP:
            continue
        for k in range(len(nails)):
            squared = 0.0
            for d in range(3):
                squared += (points[n, d] - nails[k, d]) ** 2
            if squared < nails[k, 3] ** 2:
                along, length = 0.0, 0.0
                for d in range(3):
                    half = towards[n, d] + sight[n, d]
                    along += half * normals[n, d]
                    length += half * half
                if along > 0.0:
                    shine[n] = (along / np.sqrt(length)) ** SHININESS
                break
    return shine
