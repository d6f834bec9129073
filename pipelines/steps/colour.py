"""Laser-off frames to the colours of one camera's stripe points."""

from collections.abc import Mapping
from pathlib import Path

from footscan.cloud.colour import point_colours
from footscan.frames.array import discard
from footscan.frames.image import Rgb
from footscan.frames.reader import read_frame
from pipelines.arrays import pack, unpack
from schemas.base.errors import DamagedError
from schemas.frames import FrameManifest


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Look up the colour of each stripe point in the laser-off frames.

    `inputs`: `stripe`, and the manifest of the camera's `background`; `places`: the array of the `background`.
    A background of one frame shows surroundings that move with the camera, not the skin: then no point has a colour.
    """
    del parameters
    stripe = unpack(inputs["stripe"])["stripe"]
    manifest = FrameManifest.model_validate_json(inputs["background"])
    frames = len(manifest.frames)

    def laser_off(number: int) -> Rgb | None:
        return read_frame(places["background"], manifest, number) if frames > 1 and number < frames else None

    try:
        colours, seen = point_colours(stripe, laser_off)
    except DamagedError:
        discard(places["background"])  # the next run ingests it again
        raise
    return pack(colours=colours, seen=seen)
