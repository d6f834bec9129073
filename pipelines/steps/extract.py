"""Frames to stripe points of one camera."""

from collections.abc import Mapping
from pathlib import Path

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
    try:
        return pack(stripe=extract_film(read_frames(places["array"], manifest), parameters))
    except DamagedError:
        discard(places["array"])  # so that it is ingested anew
        raise
