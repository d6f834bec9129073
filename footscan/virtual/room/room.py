"""The picture apart from the stripe: the object in the light of the room, the hardware behind it, its glints."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.virtual.optics.scanner import HEIGHT, WIDTH, Camera
from footscan.virtual.optics.scene import Scene
from footscan.virtual.optics.texture import Texture
from footscan.virtual.optics.views import View
from footscan.virtual.portable import cos_sin, dot, exp, gaussian_blur
from schemas.parameters.simulation import SimulationSettings

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

COARSE = 2
"""The room's light is cast for one pixel in COARSE x COARSE of a film and interpolated: a bound of time."""
LEVELS = {"dark": 0.004, "ambient": 0.25, "bright": 2.2}
"""Room light on a white surface that faces the lamps, in units of the sensor's white. Chosen by hand."""
_LAMPS = np.array([0.25, 0.35, 0.90])
"""Direction of the lamps, scanner frame, not of unit length. Chosen by hand."""


class Backdrop(NamedTuple):
    """The static picture of hardware and room around one camera, as it travels along."""

    room: Singles
    """(rows, columns, 3) lit by the room."""
    white_glints: Singles
    """(rows, columns) reflections of lamps."""
    red_glints: Singles
    """(rows, columns) reflections of laser light."""


def backdrop(camera: Camera, scanner_seed: int, settings: SimulationSettings) -> Backdrop:
    """The backdrop of `camera`, fixed for the scanner."""
    random = np.random.default_rng([scanner_seed, camera.id, 2])
    level = LEVELS[settings.ambient]
    white, red = _glints(random), _glints(random)
    return Backdrop(
        (_hardware(random) * level).astype(np.float32),
        (white * settings.glints * (0.15 + 4.0 * min(level, 1.0))).astype(np.float32),
        (red * settings.glints * settings.laser_exposure / 30.0).astype(np.float32),
    )


@dataclass(frozen=True)
class CoarseRays:
    """One ray of a view for each block of pixels, row by row."""

    shape: tuple[int, int]
    """Rows and columns of blocks."""

    origins: Floats
    directions: Floats
    weights: Floats


def coarse_rays(view: View, block: int) -> CoarseRays:
    """Returns the rays of `view` through the middles of blocks of `block` x `block` pixels."""
    pixels = np.arange(HEIGHT * WIDTH).reshape(HEIGHT, WIDTH)[::block, ::block].ravel()
    origins, directions = view.at(pixels, np.full((1, 2), (block - 1) / 2.0))
    return CoarseRays((HEIGHT // block, WIDTH // block), origins, directions, view.weights[pixels])


def lit_object(
    scene: Scene, x: float, straight: CoarseRays, mirrored: CoarseRays | None, texture: Texture, level: float
) -> tuple[Singles, Singles]:
    """The object in the room's light, with its mirror image in the glass for an upper camera.

    Returns
    -------
    (R, C) brightness, and (R, C) coverage: 1 where the object is, 0 beside it; both float32, one value a ray.
    """
    brightness, coverage = np.zeros(len(straight.origins)), np.zeros(len(straight.origins), np.float32)
    hit, light = _room_light(scene, x, straight.origins, straight.directions, texture)
    brightness[hit] = level * light * straight.weights[hit]
    coverage[hit] = 1.0
    if mirrored is not None:
        beside = np.flatnonzero((coverage == 0.0) & (mirrored.weights > 0.0))
        hit, light = _room_light(scene, x, mirrored.origins[beside], mirrored.directions[beside], texture)
        brightness[beside[hit]] = level * light * mirrored.weights[beside[hit]]
    return brightness.astype(np.float32).reshape(straight.shape), coverage.reshape(straight.shape)


def _room_light(
    scene: Scene, x: float, origins: Floats, directions: Floats, texture: Texture
) -> tuple[NDArray[np.int64], Floats]:
    """Indices of the rays that meet the object, and its brightness there, apart from its colour."""
    origins = origins + np.array([x, 0.0, 0.0])
    hits = scene.cast(origins, directions)
    points = origins[hits.ray] + hits.distance[:, None] * directions[hits.ray]
    front = np.einsum("ij,ij->i", hits.facet_normals, directions[hits.ray]) < 0.0
    up = hits.normals[:, 2]
    lamps = np.maximum(dot(hits.normals, _LAMPS / np.sqrt((_LAMPS**2).sum())), 0.0)
    near_glass = 1.0 - 0.6 * exp(-np.maximum(points[:, 2], 0.0) / 6.0) * (up < 0.3)
    return hits.ray, front * (0.28 + 0.18 * up + 0.54 * lamps) * near_glass * texture.at(points)


def _hardware(random: np.random.Generator) -> Floats:
    """Rails, plates and a bright part of the room, out of focus; reflectance seen at each pixel, (rows, columns, 3)."""
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    slope = random.normal(0.0, 0.1, 2)
    grey = 0.16 + slope[0] * (columns / WIDTH - 0.5) + slope[1] * (rows / HEIGHT - 0.5)
    for _ in range(7):
        angle, offset, breadth = random.uniform(0.0, np.pi), random.uniform(-260.0, 260.0), random.uniform(6.0, 50.0)
        cos, sin = cos_sin(np.degrees(angle))
        across = cos * (columns - WIDTH / 2) + sin * (rows - HEIGHT / 2) - offset
        grey = np.where(np.abs(across) < breadth / 2.0, random.uniform(0.02, 0.3), grey)
    side, length = random.integers(4), random.uniform(100.0, 220.0)
    start = random.uniform(0.0, (WIDTH if side < 2 else HEIGHT) - length)
    along, depth = (columns, rows) if side < 2 else (rows, columns)
    depth = depth if side % 2 == 0 else depth.max() - depth
    grey = np.where((along > start) & (along < start + length) & (depth < random.uniform(15.0, 40.0)), 1.1, grey)
    grey = gaussian_blur(np.maximum(grey, 0.01), 2.5)
    tint = np.array([1.0, 0.97, 0.93]) * random.normal(1.0, 0.03, 3)
    return np.asarray(grey[:, :, None] * tint)


def _glints(random: np.random.Generator) -> Floats:
    """A few bright, mostly oblong spots, (rows, columns), at most some times the sensor's white."""
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    picture = np.zeros((HEIGHT, WIDTH))
    for _ in range(3):
        i, j = random.uniform(8, WIDTH - 8), random.uniform(8, HEIGHT - 8)
        angle, size, stretch = random.uniform(0, np.pi), random.uniform(0.9, 2.2), random.uniform(1.0, 4.0)
        cos, sin = cos_sin(np.degrees(angle))
        along = (cos * (columns - i) + sin * (rows - j)) / (size * stretch)
        across = (cos * (rows - j) - sin * (columns - i)) / size
        picture += random.uniform(0.6, 5.0) * exp(-0.5 * (along**2 + across**2))
    return picture
