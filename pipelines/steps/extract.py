"""Frames to stripe points of one camera."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from footscan.frames.image import Rgb
from footscan.frames.ingest import discard
from footscan.frames.reader import read_frames
from footscan.stripe.film import extract_film
from pipelines.arrays import pack
from schemas.errors import DamagedError
from schemas.frames import FrameManifest
from schemas.parameters.extraction import ExtractionParameters


def run(inputs: Mapping[str, bytes], parameters: ExtractionParameters, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `manifest`; `places`: the `array` of frames."""
    manifest = FrameManifest.model_validate_json(inputs["manifest"])
    lost: list[int] = []
    try:
        stripe = extract_film(_noting_lost(read_frames(places["array"], manifest), lost), parameters)
    except DamagedError:
        discard(places["array"])  # so that it is ingested anew
        raise
    return pack(stripe=stripe, lost=np.array(lost, np.int32))


def _noting_lost(frames: Iterator[Rgb | None], lost: list[int]) -> Iterator[Rgb | None]:
    """The same frames; the numbers of those that cannot be had are added to `lost`."""
    for number, frame in enumerate(frames):
        if frame is None:
            lost.append(number)
        yield frame
