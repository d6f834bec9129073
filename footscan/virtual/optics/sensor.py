"""From light to a webcam's JPEG: sensor noise, Bayer mosaic and its interpolation, tone curve, compression."""

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from footscan.compiled import compiled
from schemas.parameters.simulation import SimulationSettings

Singles = NDArray[np.float32]
Bytes = NDArray[np.uint8]

FULL_WELL_ELECTRONS = 6000.0
"""Electrons of a pixel at the sensor's white; their shot noise is the root of their number. Chosen by hand."""
READ_NOISE = 0.0012
"""Standard deviation, in units of the sensor's white. Chosen by hand."""
CODES = 4096
"""Of a converter with 12 bits."""


def photograph(light: Singles, random: np.random.Generator, settings: SimulationSettings) -> Bytes:
    """Convert `light`, float32 with 1 for the sensor's white, to a uint8 RGB picture; both (rows, columns, 3)."""
    normal = random.standard_normal(light.shape if not settings.bayer else light.shape[:2], dtype=np.float32)
    tone = _tone_curve()
    if not settings.bayer:
        return np.asarray(tone[_codes(_expose(light, normal, settings.noise))])
    mosaic = expose_mosaic(light, normal, np.float32(settings.noise))
    return np.asarray(develop(mosaic, tone))


def compress(picture: Bytes, settings: SimulationSettings) -> bytes:
    """Compress `picture` (rows, columns, 3) uint8 RGB to JPEG."""
    jpeg = simplejpeg.encode_jpeg(
        picture, quality=settings.jpeg_quality, colorspace="RGB", colorsubsampling=settings.jpeg_chroma
    )
    return bytes(jpeg)


def _tone_curve() -> Bytes:
    """A webcam's curve on 12-bit codes: the sRGB curve (IEC 61966-2-1), blended with a smooth step for more contrast.

    The shares of the blend are chosen by hand.
    """
    linear = np.linspace(0.0, 1.0, CODES)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    contrast = 0.75 * curve + 0.25 * curve**2 * (3.0 - 2.0 * curve)
    return np.rint(255.0 * contrast).astype(np.uint8)


def _expose(light: Singles, normal: Singles, noise: float) -> Singles:
    spread = noise * np.sqrt(np.maximum(light, 0.0) / FULL_WELL_ELECTRONS + READ_NOISE**2)
    return np.asarray(np.clip(light + spread * normal, 0.0, 1.0), dtype=np.float32)


def _codes(signal: Singles) -> NDArray[np.int64]:
    return np.rint(signal * (CODES - 1)).astype(np.int64)


@compiled
def expose_mosaic(light: Singles, normal: Singles, noise: np.float32) -> Singles:
    """The sensor's readings: one colour a pixel, RG over GB, with shot and read noise, clipped at its white."""
    height, width, _ = light.shape
    mosaic = np.empty((height, width), dtype=np.float32)
    for j in range(height):
        for i in range(width):
            signal = light[j, i, j % 2 + i % 2]
            spread = noise * np.sqrt(signal / np.float32(FULL_WELL_ELECTRONS) + np.float32(READ_NOISE**2))
            mosaic[j, i] = min(max(signal + spread * normal[j, i], np.float32(0.0)), np.float32(1.0))
    return mosaic


@compiled
def develop(mosaic: Singles, tone: Bytes) -> Bytes:
    """Bilinear interpolation of the mosaic's missing colours, mirrored at the borders, and the tone curve."""
    height, width = mosaic.shape
    picture = np.empty((height, width, 3), dtype=np.uint8)
    scale = np.float32(CODES - 1)
    half, quarter = np.float32(0.5), np.float32(0.25)
    for j in range(height):
        up, down = abs(j - 1), height - 1 - abs(height - 2 - j)
        for i in range(width):
            left, right = abs(i - 1), width - 1 - abs(width - 2 - i)
            here = mosaic[j, i]
            sides = (mosaic[j, left] + mosaic[j, right]) * half
            ends = (mosaic[up, i] + mosaic[down, i]) * half
            if j % 2 == i % 2:
                corners = (mosaic[up, left] + mosaic[up, right] + mosaic[down, left] + mosaic[down, right]) * quarter
                green = (sides + ends) * half
                red, blue = (here, corners) if j % 2 == 0 else (corners, here)
            else:
                green = here
                red, blue = (sides, ends) if j % 2 == 0 else (ends, sides)
            picture[j, i, 0] = tone[int(red * scale + half)]
            picture[j, i, 1] = tone[int(green * scale + half)]
            picture[j, i, 2] = tone[int(blue * scale + half)]
    return picture
