"""Laser-off frames to the colours of one camera's stripe points."""

from collections.abc import Mapping
from pathlib import Path

from footscan.cloud.colour import point_colours
from footscan.frames.array import IngestedFrames
from footscan.frames.image import Rgb
from footscan.frames.reader import pixel_frames
from pipelines.arrays import pack, unpack
from schemas.frames import FrameManifest


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Look up the colour of each stripe point in the laser-off frames.

    `inputs`: `stripe`, and the manifest of the camera's `background`; `places`: the array of the `background`.
    A background of one frame shows surroundings that move with the camera, not the skin: then no point has a colour.
    """
    del parameters
    stripe = unpack(inputs["stripe"])["stripe"]
    background = IngestedFrames(places["background"], FrameManifest.model_validate_json(inputs["background"]))

    def laser_off(number: int) -> Rgb | None:
        return next(pixel_frames(background, [number])) if background.count > 1 and number < background.count else None

    colours, seen = point_colours(stripe, laser_off)
    return pack(colours=colours, seen=seen)
