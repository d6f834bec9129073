"""Settings of the virtual scanner: its travel, its light, and the strength of each effect of real cameras."""

from typing import Annotated, Literal

from pydantic import Field

from schemas.base.model import Document

Seed = Annotated[int, Field(ge=0, lt=2**32)]
Scale = Annotated[float, Field(ge=0, le=100)]
"""1 is the effect as in a real scanner, 0 switches it off."""


class SimulationSettings(Document):
    """One recording of the virtual scanner. Equal settings give equal bytes."""

    seed: Seed = 1
    """Seed of everything that differs between recordings: noise, speckle, flicker, texture of the skin, clicks."""
    scanner_seed: Seed = 1
    """Seed of the scanner itself: mounting, lenses, glints. Recordings of one scanner share it."""

    start_mm: Annotated[float, Field(ge=-1e4, le=1e4)] = 0.0
    """X of the laser plane at the first frame."""
    step_mm: Annotated[float, Field(gt=0, le=1000)] = 2.0
    """Travel from frame to frame."""
    frames: Annotated[int, Field(ge=1, le=10_000)] = 200
    """Frames of each camera."""
    frames_per_second: Annotated[int, Field(ge=1, le=120)] = 18
    """Frame rate in the header of the films."""

    ambient: Literal["dark", "ambient", "bright"] = "ambient"
    """Light in the room; `bright` saturates parts of the picture."""
    laser_exposure: Scale = 24.0
    """Brightest laser line on a matt white surface at the middle distance, in units of the sensor's white."""
    laser_sigma_mm: Annotated[float, Field(gt=0.02, le=5)] = 0.32
    """Half-width of the laser sheet at its focus: the standard deviation of its Gaussian across X."""
    leak: Scale = 1.0
    """Red light that passes the green and blue filters; it turns an over-exposed stripe white."""
    speckle: Annotated[float, Field(ge=0, le=1)] = 0.12
    """Contrast (standard deviation over mean) of the laser's speckle in one pixel."""
    halo: Scale = 1.0
    """Light scattered under the skin, and the lens's veil around bright parts."""
    ghost: Scale = 1.0
    """Reflections in the glass plate."""
    glints: Scale = 1.0
    """Static reflections on the hardware, some red, some white."""
    flicker: Scale = 1.0
    """Change of room light and glints from frame to frame."""
    texture: Scale = 1.0
    """Unevenness of the surface's colour."""
    distortion: Scale = 1.0
    """Radial and tangential distortion of the lenses."""
    blur_px: Annotated[float, Field(ge=0, le=10)] = 0.7
    """Point spread of lens and pixel, standard deviation."""
    noise: Scale = 1.0
    """Shot and read noise of the sensor."""
    bayer: bool = True
    """True if each pixel records one colour and the others are interpolated."""
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 85
    """Quality of the camera's JPEG compression."""
    jpeg_chroma: Literal["444", "422", "420"] = "420"
    """How the JPEG samples colour: 420 keeps one value for four pixels."""
    click_error_px: Scale = 0.3
    """Standard deviation with which a person clicks a corner, before rounding to half a pixel."""
