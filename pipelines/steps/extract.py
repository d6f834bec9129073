"""Frames to stripe points of one camera."""

from collections.abc import Iterator, Mapping
from itertools import repeat
from pathlib import Path

import numpy as np

from footscan.frames.array import discard
from footscan.frames.image import Rgb
from footscan.frames.reader import read_frames
from footscan.stripe.film import extract_film
from pipelines.arrays import pack
from schemas.base.errors import DamagedError
from schemas.frames import FrameManifest
from schemas.parameters.extraction import ExtractionParameters


def run(inputs: Mapping[str, bytes], parameters: ExtractionParameters, places: Mapping[str, Path]) -> bytes:
    """Extract the stripe points of all frames.

    `inputs`: `manifest`, and that of the `background` if the camera has one; `places`: the `array` of the frames, and
    that of the `background`. The result holds the `stripe` and the numbers of the `lost` frames.
    """
    manifest = FrameManifest.model_validate_json(inputs["manifest"])
    lost: list[int] = []
    frames = _noting_lost(_frames(places["array"], manifest), lost)
    backgrounds = None
    if "background" in inputs:
        laser_off = FrameManifest.model_validate_json(inputs["background"])
        backgrounds = _backgrounds(places["background"], laser_off, len(manifest.frames))
    stripe = extract_film(frames, parameters, backgrounds)
    return pack(stripe=stripe, lost=np.array(lost, np.int32))


def _frames(array: Path, manifest: FrameManifest) -> Iterator[Rgb | None]:
    """The frames of an array; a damaged array is discarded, so that the next run ingests it again."""
    try:
        yield from read_frames(array, manifest)
    except DamagedError:
        discard(array)
        raise


def _noting_lost(frames: Iterator[Rgb | None], lost: list[int]) -> Iterator[Rgb | None]:
    """The same frames; the numbers of lost ones are added to `lost`."""
    for number, frame in enumerate(frames):
        if frame is None:
            lost.append(number)
        yield frame


def _backgrounds(array: Path, manifest: FrameManifest, count: int) -> Iterator[Rgb | None]:
    """The laser-off frame of each of `count` frames; a single one is used for all."""
    backgrounds = _frames(array, manifest)
    if len(manifest.frames) == count:
        return backgrounds
    return repeat(next(backgrounds), count)  # the iterator is not used after its first frame
