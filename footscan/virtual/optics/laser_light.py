"""The laser's light on the object as a camera sees it: a picture of the stripe before lens, sensor and speckle."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.virtual.optics.glass import directions_from_below, exits_above, reflectance
from footscan.virtual.optics.scanner import FAN_DEGREES, HEIGHT, WIDTH, Laser
from footscan.virtual.optics.scene import Hits, Scene
from footscan.virtual.optics.texture import Reflectance
from footscan.virtual.optics.views import View
from footscan.virtual.portable import cos_sin, dot, exp
from schemas.parameters.simulation import SimulationSettings

Floats = NDArray[np.float64]

FOCUS_MM = 215.0
"""Distance from the laser at which the sheets are thinnest. Chosen by hand."""
DIVERGENCE = 0.0025
"""Growth of the sheet's standard deviation away from the focus, mm per mm. Chosen by hand."""
DEFOCUS_MM = 120.0
"""Largest distance of the object from the focus that the search for pixels allows for. Chosen by hand."""
REACH_SIGMAS = 4.6
"""Half width of the sheet, in standard deviations: there its light is 2.5e-5 of that in the middle."""
FAN_EDGE_DEGREES = 2.0
"""Within this angle the fan of light falls to zero. Chosen by hand."""
DARK = 1e-4
"""Laser light below this, in units of the sensor's white, is taken as none: no shadow ray is cast. Chosen by hand."""


def stripe_picture(
    scene: Scene, x: float, lasers: tuple[Laser, ...], view: View, texture: Reflectance, settings: SimulationSettings
) -> Floats:
    """Laser light that each pixel receives along `view` with the laser plane at X = `x`, mm.

    Each pixel is the mean of four rays; in reflections it is a single ray. For each ray the sheet's Gaussian is
    widened by the ray's own footprint on the surface, so that the sum over the pixels is right even where the stripe is
    narrower than a pixel.

    Returns
    -------
    (rows, columns) float64, in units of the sensor's white.
    """
    picture = np.zeros(HEIGHT * WIDTH)
    reach = REACH_SIGMAS * float(np.sqrt(settings.laser_sigma_mm**2 + (DIVERGENCE * DEFOCUS_MM) ** 2))
    pixels = _pixels_near(scene.patches_near(x, reach) - np.array([x, 0.0, 0.0]), view)
    if not len(pixels):
        return picture.reshape(HEIGHT, WIDTH)
    travel = np.array([x, 0.0, 0.0])
    samples = len(view.subpixels)
    origins, directions = view.at(pixels, view.subpixels)
    owners = np.tile(pixels, samples)
    hits = scene.cast(origins + travel, directions)
    owners, origins, directions = owners[hits.ray], origins[hits.ray], directions[hits.ray]
    points = origins + hits.distance[:, None] * directions
    front = np.einsum("ij,ij->i", hits.facet_normals, directions) < 0.0  # an open mesh is dark inside
    near = front & (np.abs(points[:, 0]) < 4.0 * reach)
    hits = Hits(hits.ray[near], hits.distance[near], hits.facet_normals[near], hits.normals[near])
    owners, origins, directions, points = owners[near], origins[near], directions[near], points[near]
    spread = _spread_along_x(
        hits.distance, directions, hits.facet_normals, owners, *view.origin_steps, *view.direction_steps
    )
    light = laser_light(scene, x, lasers, points, hits, spread / samples, settings)
    if view.mirrored:
        lit = np.flatnonzero(light > 0.0)
        up = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (len(lit), 3))
        eye = view.eye * np.array([1.0, 1.0, -1.0]) + travel
        blocked = scene.hidden(origins[lit] + travel, up, np.broadcast_to(eye, up.shape))
        light[lit[blocked]] = 0.0
    light *= scene.surface.laser_albedo * texture.at(points + travel) * view.weights[owners] / samples
    np.add.at(picture, owners, light)
    return picture.reshape(HEIGHT, WIDTH)


def laser_light(
    scene: Scene,
    x: float,
    lasers: tuple[Laser, ...],
    points: Floats,
    hits: Hits,
    spread: Floats,
    settings: SimulationSettings,
) -> Floats:
    """Irradiance of surface `points` (N, 3), frame of the heads, by all lasers that are not hidden from them.

    `spread` (N,) mm^2 is the variance in X of the patch that each point stands for. At 1 a white surface is as bright
    as the sensor's white.
    """
    travel = np.array([x, 0.0, 0.0])
    total = np.zeros(len(points))
    for laser in lasers:
        beams = beams_of(laser, points)
        light = _sheet(points, beams, hits.normals, hits.facet_normals, spread, laser, settings.laser_sigma_mm)
        lit = np.flatnonzero(light * settings.laser_exposure > DARK)
        hidden = scene.hidden(points[lit] + travel, hits.facet_normals[lit], beams.sources[lit] + travel)
        total[lit[~hidden]] += light[lit[~hidden]]
    return total * settings.laser_exposure


class Beams(NamedTuple):
    """The light of a laser that arrives at points."""

    sources: Floats
    """(N, 3) mm: where the light comes from above the glass: the laser, or where its light leaves the glass."""
    towards: Floats
    """(N, 3) unit vectors from the points to there."""
    transmitted: Floats
    """(N,) share that the glass lets through."""


def beams_of(laser: Laser, points: Floats) -> Beams:
    """Follow the light of a laser to `points` (N, 3), mm, above the glass plate at Z = 0."""
    position = np.asarray(laser.position)
    if not laser.below_glass:
        way = position - points
        towards = way / np.linalg.norm(way, axis=1, keepdims=True)
        return Beams(np.broadcast_to(position, points.shape), towards, np.ones(len(points)))
    directions = directions_from_below(position, points, thickness=laser.plate_mm)
    transmitted = (1.0 - reflectance(directions[:, 2])) ** 2
    return Beams(exits_above(position, directions, thickness=laser.plate_mm), -directions, transmitted)


def _sheet(
    points: Floats, beams: Beams, normals: Floats, facet_normals: Floats, spread: Floats, laser: Laser, sigma_mm: float
) -> Floats:
    """Brightness of a Gaussian light sheet on a surface, in units of its middle at the focus, met at right angles."""
    facing = np.einsum("ij,ij->i", facet_normals, beams.towards) > 0.0
    cosine = np.where(facing, np.maximum(np.einsum("ij,ij->i", normals, beams.towards), 0.0), 0.0)
    distance = np.linalg.norm(points - np.asarray(laser.position), axis=1)
    variance = sigma_mm**2 + (DIVERGENCE * (distance - FOCUS_MM)) ** 2 + spread
    profile = exp(-0.5 * points[:, 0] ** 2 / variance) * sigma_mm / np.sqrt(variance)
    # A Powell lens: even light with a soft edge.
    outer, inner = cos_sin(FAN_DEGREES / 2.0)[0], cos_sin(FAN_DEGREES / 2.0 - FAN_EDGE_DEGREES)[0]
    fan = np.clip((-dot(beams.towards, np.asarray(laser.axis)) - outer) / (inner - outer), 0.0, 1.0)
    return np.asarray(profile * cosine * fan * beams.transmitted * FOCUS_MM / distance)


def _pixels_near(patches: Floats, view: View) -> NDArray[np.int64]:
    """Pixels, ascending, that small triangles (K, 3, 3) cover as far as they face the camera."""
    normals = np.cross(patches[:, 1] - patches[:, 0], patches[:, 2] - patches[:, 0])
    sight = view.eye - patches[:, 0]
    facing = np.einsum("ij,ij->i", normals, sight)
    scale = np.linalg.norm(normals, axis=1) * np.linalg.norm(sight, axis=1)
    patches = patches[facing > -0.3 * scale]  # the slack is for refraction, which turns the sight
    corners = view.project(patches.reshape(-1, 3)).reshape(-1, 3, 2)
    corners = corners[np.isfinite(corners).all(axis=(1, 2))]
    least, most = np.floor(corners.min(axis=1)), np.ceil(corners.max(axis=1))
    covered = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    _cover(covered, least.astype(np.int64), most.astype(np.int64))
    return np.flatnonzero(covered.ravel() & (view.weights > 0.0))


@compiled
def _cover(covered: NDArray[np.bool_], least: NDArray[np.int64], most: NDArray[np.int64]) -> None:
    height, width = covered.shape
    for k in range(len(least)):
        for j in range(max(least[k, 1], 0), min(most[k, 1] + 1, height)):
            for i in range(max(least[k, 0], 0), min(most[k, 0] + 1, width)):
                covered[j, i] = True


@compiled
def _spread_along_x(
    distance: Floats,
    directions: Floats,
    normals: Floats,
    owners: NDArray[np.int64],
    origin_right: Floats,
    origin_down: Floats,
    direction_right: Floats,
    direction_down: Floats,
) -> Floats:
    """Variance in X, mm^2, of the surface that each pixel sees, after H. Igehy, "Tracing ray differentials" (1999)."""
    spread = np.empty(len(distance))
    for k in range(len(distance)):
        pixel, t = owners[k], distance[k]
        nx, ny, nz = normals[k, 0], normals[k, 1], normals[k, 2]
        along = nx * directions[k, 0] + ny * directions[k, 1] + nz * directions[k, 2]
        slope = directions[k, 0] / min(along, -0.02)  # grazing rays would see endless patches
        right = origin_right[pixel, 0] + t * direction_right[pixel, 0]
        right -= slope * (
            nx * right
            + ny * (origin_right[pixel, 1] + t * direction_right[pixel, 1])
            + nz * (origin_right[pixel, 2] + t * direction_right[pixel, 2])
        )
        down = origin_down[pixel, 0] + t * direction_down[pixel, 0]
        down -= slope * (
            nx * down
            + ny * (origin_down[pixel, 1] + t * direction_down[pixel, 1])
            + nz * (origin_down[pixel, 2] + t * direction_down[pixel, 2])
        )
        spread[k] = (right * right + down * down) / 12.0
    return spread
