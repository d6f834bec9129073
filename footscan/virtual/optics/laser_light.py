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
from footscan.virtual.portable import cos_sin, exponential
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
    pixels = _pixels_near(scene.patches_near(x, reach) - np.array([x, 0.0, 0.0]), reach, view)
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
    edges = cos_sin(FAN_DEGREES / 2.0)[0], cos_sin(FAN_DEGREES / 2.0 - FAN_EDGE_DEGREES)[0]
    total = np.zeros(len(points))
    for laser in lasers:
        beams = beams_of(laser, points)
        position, axis, sigma = np.array(laser.position), np.array(laser.axis), settings.laser_sigma_mm
        light = _sheet(points, beams, hits.normals, hits.facet_normals, spread, position, axis, sigma, edges)
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
        return Beams(np.tile(position, (len(points), 1)), towards, np.ones(len(points)))
    directions = directions_from_below(position, points, thickness=laser.plate_mm)
    transmitted = (1.0 - reflectance(directions[:, 2])) ** 2
    return Beams(exits_above(position, directions, thickness=laser.plate_mm), -directions, transmitted)


@compiled
def _sheet(
    points: Floats,
    beams: Beams,
    normals: Floats,
    facet_normals: Floats,
    spread: Floats,
    position: Floats,
    axis: Floats,
    sigma: float,
    edges: tuple[float, float],
) -> Floats:
    """Brightness of a Gaussian light sheet on a surface, in units of its middle at the focus, met at right angles.

    `edges` of the fan, as cosines of the angle to its axis: outside the first it is dark, inside the second even.
    """
    outer, inner = edges
    light = np.zeros(len(points))
    for k in range(len(points)):
        facing = cosine = along = squares = 0.0
        for c in range(3):
            facing += facet_normals[k, c] * beams.towards[k, c]
            cosine += normals[k, c] * beams.towards[k, c]
            along -= beams.towards[k, c] * axis[c]
            squares += (points[k, c] - position[c]) * (points[k, c] - position[c])
        if facing <= 0.0 or cosine <= 0.0 or along <= outer:
            continue
        distance = np.sqrt(squares)
        off_focus = DIVERGENCE * (distance - FOCUS_MM)
        variance = sigma * sigma + off_focus * off_focus + spread[k]
        profile = exponential(-0.5 * points[k, 0] * points[k, 0] / variance) * sigma / np.sqrt(variance)
        fan = min((along - outer) / (inner - outer), 1.0)  # a Powell lens: even light with a soft edge
        light[k] = profile * cosine * fan * beams.transmitted[k] * FOCUS_MM / distance
    return light


def _pixels_near(patches: Floats, reach: float, view: View) -> NDArray[np.int64]:
    """Pixels, ascending, that see small triangles (K, 3, 3) with |X| <= `reach` mm, as far as these face the camera."""
    patches = patches[_facing(patches, view.eye)]
    corners = view.project(patches.reshape(-1, 3)).reshape(-1, 3, 2)
    seen = np.isfinite(corners).all(axis=(1, 2))
    covered = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    _cover(covered, corners[seen], patches[seen, :, 0], reach)
    return np.flatnonzero(covered.ravel() & (view.weights > 0.0))


@compiled
def _facing(patches: Floats, eye: Floats) -> NDArray[np.bool_]:
    """Whether triangles (N, 3, 3) show `eye` (3,) their front, with slack for refraction, which turns the sight."""
    facing = np.empty(len(patches), np.bool_)
    for k in range(len(patches)):
        along = normal = sight = 0.0
        for c in range(3):
            d, e = (c + 1) % 3, (c + 2) % 3
            part = (patches[k, 1, d] - patches[k, 0, d]) * (patches[k, 2, e] - patches[k, 0, e])
            part -= (patches[k, 1, e] - patches[k, 0, e]) * (patches[k, 2, d] - patches[k, 0, d])
            way = eye[c] - patches[k, 0, c]
            along, normal, sight = along + part * way, normal + part * part, sight + way * way
        facing[k] = along > -0.3 * np.sqrt(normal * sight)
    return facing


@compiled
def _cover(covered: NDArray[np.bool_], corners: Floats, x: Floats, reach: float) -> None:
    """Mark the pixels around the part of each triangle with |X| <= `reach`: `corners` (K, 3, 2) px, `x` (K, 3) mm."""
    height, width = covered.shape
    for k in range(len(corners)):
        left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
        for start in range(3):
            end = (start + 1) % 3
            way = x[k, end] - x[k, start]
            if way == 0.0:
                way = 1e-300
            one, other = (-reach - x[k, start]) / way, (reach - x[k, start]) / way
            first, last = max(min(one, other), 0.0), min(max(one, other), 1.0)
            if first > last:
                continue
            for share in (first, last):
                i = corners[k, start, 0] + share * (corners[k, end, 0] - corners[k, start, 0])
                j = corners[k, start, 1] + share * (corners[k, end, 1] - corners[k, start, 1])
                left, right, top, bottom = min(left, i), max(right, i), min(top, j), max(bottom, j)
        for j in range(int(max(np.floor(top), 0.0)), int(min(np.ceil(bottom), height - 1.0)) + 1):
            for i in range(int(max(np.floor(left), 0.0)), int(min(np.ceil(right), width - 1.0)) + 1):
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
