"""One frame of one camera: all light on its sensor, and the JPEG that the camera sends."""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.virtual.optics.laser_light import stripe_picture
from footscan.virtual.optics.scanner import HEIGHT, WIDTH, VirtualScanner
from footscan.virtual.optics.scene import Scene, Surface
from footscan.virtual.optics.sensor import compress, photograph
from footscan.virtual.optics.texture import Texture
from footscan.virtual.optics.views import camera_views
from footscan.virtual.portable import gaussian_blur, gaussian_kernel
from footscan.virtual.room.room import COARSE, LEVELS, Backdrop, backdrop, coarse_rays, lit_object
from schemas.parameters.simulation import SimulationSettings

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

LASER_COLOUR = (1.0, 0.12, 0.09)
"""Response of a red, green and blue pixel to the laser's 650 nm; the last two are the filters' leaks. Chosen
by hand."""
HALO_LIMIT = 0.9
"""Largest share of the laser's light that the halo takes. Chosen by hand."""
_BLOCK = 4
"""Glow and veil are computed for blocks of 4 x 4 pixels: a bound of time."""
_MARGIN_PX = 6
"""Margin of the window around the stripe that is blurred. Chosen by hand."""
GRAIN_SIGMA_PX = 0.55
"""Of the Gaussian that gives speckle its grain. Chosen by hand."""


class CameraRenderer:
    """Films with one camera; whatever is the same in all frames is computed once.

    Equal arguments give equal bytes, in whatever order frames are requested.
    """

    def __init__(
        self,
        scanner: VirtualScanner,
        camera_id: int,
        settings: SimulationSettings,
        texture: Texture,
        *,
        coarse: int = COARSE,
    ) -> None:
        """`coarse`: the room's light is cast for one pixel in `coarse` x `coarse`, of 1, 2 and 4."""
        self.camera = scanner.camera(camera_id)
        self._lasers = scanner.lasers
        self._settings = settings
        self._straight, self._reflected = camera_views(self.camera)
        self._coarse = coarse_rays(self._straight, coarse)
        mirror = self._reflected.mirrored and settings.ghost > 0.0
        self._coarse_mirrored = coarse_rays(self._reflected, coarse) if mirror else None
        self._backdrop = backdrop(self.camera, scanner.seed, settings)
        self._texture = texture

    def jpeg(self, scene: Scene, x: float, frame: int) -> bytes:
        """Returns the JPEG of frame number `frame`, with the laser plane at X = `x` mm."""
        return compress(self.picture(scene, x, frame), self._settings)

    def picture(self, scene: Scene, x: float, frame: int) -> NDArray[np.uint8]:
        """Returns the picture before compression, (rows, columns, 3) uint8 RGB."""
        random = np.random.default_rng([self._settings.seed, self.camera.id, frame, 4])
        light = self.light(scene, x, random)
        return photograph(light, random, self._settings)

    def light(self, scene: Scene, x: float, random: np.random.Generator) -> Singles:
        """Light on the sensor, (rows, columns, 3) float32, 1 being its white."""
        settings = self._settings
        stripe = stripe_picture(scene, x, self._lasers, self._straight, self._texture, settings)
        if settings.ghost > 0.0:
            stripe += settings.ghost * stripe_picture(scene, x, self._lasers, self._reflected, self._texture, settings)
        level = LEVELS[settings.ambient]
        brightness, coverage = lit_object(scene, x, self._coarse, self._coarse_mirrored, self._texture, level)
        return light_on_sensor(stripe, brightness, coverage, scene.surface, self._backdrop, settings, random)


def light_on_sensor(
    stripe: Floats,
    brightness: Singles,
    coverage: Singles,
    surface: Surface,
    behind: Backdrop,
    settings: SimulationSettings,
    random: np.random.Generator,
) -> Singles:
    """All light of a frame, (rows, columns, 3) float32, 1 being the sensor's white.

    Parameters
    ----------
    stripe : (rows, columns) laser light that the surface sends to each pixel, before speckle, halo and lens.
    brightness, coverage : (rows // n, columns // n) with n = 1, 2 or 4, the object in the room's light, and where it
        is; see `lit_object`.
    """
    share = min(surface.halo * settings.halo, HALO_LIMIT)
    glow, veil = _glow(stripe, coverage, share, settings.halo)
    line = stripe_on_sensor(stripe * (1.0 - share), settings, random)
    room_flicker, white_flicker, red_flicker = 1.0 + settings.flicker * random.normal(0.0, (0.02, 0.15, 0.15))
    albedo = np.array(surface.albedo, dtype=np.float32)
    flickers = np.maximum(np.array([room_flicker, white_flicker, red_flicker]), 0.0).astype(np.float32)
    colour = laser_colour(settings)
    return np.asarray(_compose(line, glow, veil, brightness, coverage, behind, albedo, colour, flickers))


def laser_colour(settings: SimulationSettings) -> Singles:
    """Response (3,) of a red, green and blue pixel to laser light 1."""
    return np.array([1.0, LASER_COLOUR[1] * settings.leak, LASER_COLOUR[2] * settings.leak], dtype=np.float32)


def _glow(stripe: Floats, coverage: Singles, share: float, veil: float) -> tuple[Singles, Singles]:
    """Laser light scattered under the surface, seen on the object only, and in the lens, seen everywhere.

    Both (120, 160) float32, in blocks of 4 x 4 pixels. Skin passes red light over millimetres; two Gaussians stand for
    its diffusion profile, as in E. d'Eon and D. Luebke, "Advanced techniques for realistic real-time skin rendering",
    GPU Gems 3 (2007), chapter 14.
    """
    blocks = stripe.reshape(HEIGHT // _BLOCK, _BLOCK, WIDTH // _BLOCK, _BLOCK).mean(axis=(1, 3)).astype(np.float32)
    near, far, lens = (gaussian_blur(blocks, sigma, truncate=3.0) for sigma in (1.3, 3.5, 10.0))
    step = _BLOCK * coverage.shape[0] // HEIGHT
    on_object = coverage.reshape(HEIGHT // _BLOCK, step, WIDTH // _BLOCK, step).mean(axis=(1, 3))
    glow = share * (0.6 * near + 0.4 * far) * on_object
    return glow.astype(np.float32), (0.012 * veil * lens).astype(np.float32)


def stripe_on_sensor(stripe: Floats, settings: SimulationSettings, random: np.random.Generator) -> Singles:
    """The stripe through the lens, with speckle: the grain of coherent light on the sensor, about a pixel wide."""
    line = np.zeros((HEIGHT, WIDTH), dtype=np.float32)
    rows, columns = np.flatnonzero(stripe.any(axis=1)), np.flatnonzero(stripe.any(axis=0))
    if not len(rows):
        return line
    window = (
        slice(max(rows[0] - _MARGIN_PX, 0), rows[-1] + _MARGIN_PX + 1),
        slice(max(columns[0] - _MARGIN_PX, 0), columns[-1] + _MARGIN_PX + 1),
    )
    part = gaussian_blur(stripe[window].astype(np.float32), settings.blur_px, truncate=5.0, mode="constant")
    if settings.speckle > 0.0:
        grain = gaussian_blur(random.standard_normal(part.shape, dtype=np.float32), GRAIN_SIGMA_PX, truncate=6.0)
        grain /= (
            gaussian_kernel(GRAIN_SIGMA_PX, 3) ** 2
        ).sum()  # white noise keeps this share of its standard deviation
        part *= np.maximum(1.0 + settings.speckle * grain, 0.0)
    line[window] = part
    return line


@compiled
def _compose(
    line: Singles,
    glow: Singles,
    veil: Singles,
    brightness: Singles,
    coverage: Singles,
    behind: Backdrop,
    albedo: Singles,
    colour: Singles,
    flickers: Singles,
) -> Singles:
    """The sum of all light, the coarse parts interpolated."""
    height, width = line.shape
    room, white_glints, red_glints = behind
    tops, downs = _places(height, coverage.shape[0])
    lefts, rights = _places(width, coverage.shape[1])
    block_tops, block_downs = _places(height, glow.shape[0])
    block_lefts, block_rights = _places(width, glow.shape[1])
    light = np.empty((height, width, 3), dtype=np.float32)
    one = np.float32(1.0)
    for j in range(height):
        top, down, block_top, block_down = tops[j], downs[j], block_tops[j], block_downs[j]
        for i in range(width):
            left, right = lefts[i], rights[i]
            covered = _between(coverage, top, left, down, right)
            laser = line[j, i] + _between(glow, block_top, block_lefts[i], block_down, block_rights[i])
            laser += _between(veil, block_top, block_lefts[i], block_down, block_rights[i])
            laser += (one - covered) * red_glints[j, i] * flickers[2]
            lit = _between(brightness, top, left, down, right) * flickers[0]
            white = (one - covered) * white_glints[j, i] * flickers[1]
            for c in range(3):
                seen = lit * albedo[c] + (one - covered) * room[j, i, c] * flickers[0]
                light[j, i, c] = seen + white + laser * colour[c]
    return light


@compiled
def _places(pixels: int, blocks: int) -> tuple[NDArray[np.int64], Floats]:
    """For each of the `pixels` of a line: the last block whose middle is not behind it, and how far it is on the way to
    the middle of the next one, 0 to 1."""
    block = pixels // blocks
    lasts, shares = np.empty(pixels, np.int64), np.empty(pixels)
    for n in range(pixels):
        place = min(max((n - (block - 1) / 2.0) / block, 0.0), blocks - 1.0)
        lasts[n] = min(int(place), blocks - 2)
        shares[n] = place - lasts[n]
    return lasts, shares


@compiled
def _between(coarse: Singles, top: int, left: int, down: float, right: float) -> np.float32:
    """Value of a picture in blocks, bilinear between the middles of the blocks at (`top`, `left`) and the next ones."""
    upper = coarse[top, left] * (1.0 - right) + coarse[top, left + 1] * right
    lower = coarse[top + 1, left] * (1.0 - right) + coarse[top + 1, left + 1] * right
    return np.float32(upper * (1.0 - down) + lower * down)
