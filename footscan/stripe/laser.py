"""The laser of a film: its colour, found in a sample of the frames."""

from collections.abc import Iterable
from itertools import repeat
from typing import get_args

import numpy as np

from footscan.frames.image import Rgb
from footscan.frames.reader import FrameReader, backgrounds_of, pixel_frames
from footscan.stripe.extract import RED, find_stripe
from schemas.laser import Laser
from schemas.parameters.extraction import ExtractionParameters

SAMPLED = 8
"""Frames that are searched, evenly spread over the film: a bound of time."""
LEAST = 1000.0
"""Grey levels, summed over the crossings in all searched frames, by which a stripe must exceed its surroundings: that
of a faint stripe of 100 px in one frame. With less in each colour the laser stays unknown. Chosen by hand."""
MOST_CHROMA = 10
"""Grey levels by which R, G and B of a pixel may differ in a picture without colours. Chosen by hand."""


def with_found_laser(
    film: FrameReader, parameters: ExtractionParameters, background: FrameReader | None = None
) -> ExtractionParameters:
    """Replace `auto` by the laser of a film.

    `background` : as `footscan.frames.film.open_background` opens it.

    Returns
    -------
    `parameters`, with `laser` unchanged if they name one, or if no colour shows a stripe.
    """
    if parameters.laser != "auto":
        return parameters
    numbers = np.unique(np.linspace(0, film.count - 1, min(SAMPLED + 2, film.count)).round().astype(int)).tolist()
    if len(numbers) > SAMPLED:
        numbers = numbers[1:-1]  # the foot is rarely in the first and the last frame
    frames = pixel_frames(film, numbers)
    if background is None:
        return parameters.with_laser(laser_of(frames, parameters))
    own = background.count == film.count
    backgrounds = pixel_frames(background, numbers) if own else backgrounds_of(background, film.count)
    return parameters.with_laser(laser_of(frames, parameters, backgrounds))


def laser_of(
    frames: Iterable[Rgb | None],
    parameters: ExtractionParameters,
    backgrounds: Iterable[Rgb | None] | None = None,
) -> Laser | None:
    """Find the laser: the colour whose stripe stands out most; None if none does.

    frames, backgrounds : as for `extract_film`.

    Examples
    --------
    >>> frame = np.zeros((64, 64, 3), np.uint8)
    >>> frame[29:32, :, 1] = [[100], [200], [100]]
    >>> print(laser_of([frame], ExtractionParameters()))
    green
    """
    weights = dict.fromkeys(get_args(Laser), 0.0)
    is_grey = True
    for frame, background in zip(frames, backgrounds or repeat(None), strict=False):
        if frame is None:
            continue
        is_grey = is_grey and bool(np.all(np.ptp(frame[::2, ::2], axis=2) <= MOST_CHROMA))
        for laser in ("mono",) if is_grey else ("red", "green", "blue"):
            crossings = find_stripe(frame, parameters.model_copy(update={"laser": laser}), background)
            weights[laser] += float(np.sum(crossings[:, RED]))
    if not is_grey:
        weights["mono"] = 0.0
    laser = max(get_args(Laser), key=lambda name: weights[name])
    return laser if weights[laser] >= LEAST else None
