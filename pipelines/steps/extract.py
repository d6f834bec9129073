"""Frames to stripe points of one camera."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.frames.array import IngestedFrames
from footscan.frames.reader import backgrounds_of, noting_lost, pixel_frames
from footscan.stripe.film import extract_film
from footscan.stripe.laser import adapted
from pipelines.arrays import pack
from schemas.frames import FrameManifest
from schemas.parameters.extraction import ExtractionParameters


def run(inputs: Mapping[str, bytes], parameters: ExtractionParameters, places: Mapping[str, Path]) -> bytes:
    """Extract the stripe points of all frames.

    `inputs`: `manifest`, and that of the `background` if the camera has one; `places`: the `array` of the frames, and
    that of the `background`. The result holds the `stripe`, the numbers of the `lost` frames, and the
    `laser`: its colour, or `auto` if it is unknown.
    """
    film = IngestedFrames(places["array"], FrameManifest.model_validate_json(inputs["manifest"]))
    lost: list[int] = []
    background = None
    if "background" in inputs:
        manifest = FrameManifest.model_validate_json(inputs["background"])
        background = IngestedFrames(places["background"], manifest)
    parameters = adapted(film, parameters, background)
    backgrounds = None if background is None else backgrounds_of(background, film.count)
    stripe = extract_film(noting_lost(pixel_frames(film), lost), parameters, backgrounds)
    return pack(stripe=stripe, lost=np.array(lost, np.int32), laser=np.array(parameters.laser))
