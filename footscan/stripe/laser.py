"""What a film shows of its laser: the colour, and how clear the stripe is, found in a sample of the frames."""

from collections.abc import Iterable
from itertools import repeat
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from footscan.frames.image import Rgb, pixel_buffer
from footscan.frames.reader import FrameReader, backgrounds_of, pixel_frames
from footscan.robust import MAD_TO_SD
from footscan.stripe.crossings import RED, find_stripe
from footscan.stripe.redness import as_red, as_words
from schemas.laser import Laser
from schemas.parameters.extraction import ExtractionParameters

SAMPLED = 6
"""Frames that are searched, evenly spread over the film: a bound of time."""
LEAST = 1000.0
"""Grey levels, summed over the crossings in all searched frames, by which a stripe must exceed its surroundings: that
of a faint stripe of 100 px in one frame. With less in each colour the laser stays unknown. Chosen by hand."""
CERTAIN = 10.0
"""Multiple of that, and of the strength of the next colour, at which no more frames are searched for a colour."""
MOST_CHROMA = 10
"""Grey levels by which R, G and B of a pixel may differ in a picture without colours. Chosen by hand."""
SENSITIVE = 4
"""`red_threshold` at which the redness of the stripe is measured. Chosen by hand."""
STRONGEST, MAJORITY = 0.97, 0.35
"""The redness of the stripe is that quantile of the crossings at the sensitive threshold. Thresholds are lowered only
if the median is more than this share of it: in a lit room most of these crossings are faint, and not the stripe. The
median is 0.1 to 0.3 of the quantile in bright rooms, and 0.4 to 0.75 in others. Chosen by hand, on films of 18 drawn
worlds."""
NOISE_SDS = 4.0
"""A threshold is at least so many standard deviations of the noise of the redness. Chosen by hand."""

CLEAR = 40
"""Crossings a frame, two pixels apart, from which a stripe is clear, and no faint line is searched for. Chosen by
hand."""
LEAST_LINE = 12
"""Crossings a frame of a faint line at least. Chosen by hand."""

Pair = tuple[Rgb, Rgb | None]
"""A frame and its background."""


def adapted(
    film: FrameReader, parameters: ExtractionParameters, background: FrameReader | None = None
) -> ExtractionParameters:
    """Adapt parameters to a film: its laser, and thresholds for a stripe that is faint throughout.

    `background` : as `footscan.frames.film.open_background` opens it.

    Returns
    -------
    `parameters`, with `laser` unchanged if they name one, or if no colour shows a stripe; with lower thresholds if the
    stripe of the film is fainter than `full_redness`, and for a faint line (`stripe`) if there is hardly any other. For
    a `skeleton` only the laser is found.
    """
    numbers = np.unique(np.linspace(0, film.count - 1, min(SAMPLED + 2, film.count)).round().astype(int)).tolist()
    if len(numbers) > SAMPLED:
        numbers = numbers[1:-1]  # the foot is rarely in the first and the last frame
    backgrounds: Iterable[Rgb | None] | None = None
    if background is not None:
        own = background.count == film.count
        backgrounds = pixel_frames(background, numbers) if own else backgrounds_of(background, film.count)
    return adapted_to(pixel_frames(film, numbers), parameters, backgrounds)


def adapted_to(
    frames: Iterable[Rgb | None],
    parameters: ExtractionParameters,
    backgrounds: Iterable[Rgb | None] | None = None,
) -> ExtractionParameters:
    """`adapted` to a few frames; frames and backgrounds as for `extract_film`.

    Examples
    --------
    A green stripe that is 13 grey levels greener than its surroundings:

    >>> frame = np.full((64, 320, 3), 40, np.uint8)
    >>> frame[29:32, :, 1] += np.array([[7], [13], [7]], np.uint8)
    >>> parameters = adapted_to([frame], ExtractionParameters())
    >>> print(parameters.laser, parameters.red_threshold)
    green 4
    """
    pairs = [
        (_kept(frame), None if background is None else _kept(background))
        for frame, background in zip(frames, backgrounds or repeat(None), strict=False)
        if frame is not None
    ]
    clear = parameters
    if parameters.laser == "auto":
        sensitive = _scaled(parameters, SENSITIVE / parameters.red_threshold)
        clear = parameters.with_laser(_laser(pairs, parameters) or _laser(pairs, sensitive))
    if parameters.stripe == "skeleton":
        return clear
    if pairs and parameters.stripe == "auto":
        line = _faint_line(pairs, parameters, clear)
        if line is not None:
            return line
    return _with_faint_thresholds(pairs, clear)


def _faint_line(
    pairs: list[Pair], parameters: ExtractionParameters, clear: ExtractionParameters
) -> ExtractionParameters | None:
    """The parameters that find a faint line, if that is longer than the stripe that is found without them."""
    found = 0
    for frame, background in pairs:
        found += len(find_stripe(frame, clear, background))
        if found > CLEAR * len(pairs):
            return None
    faint = _scaled(parameters, 1.0 / parameters.red_threshold).model_copy(update={"stripe": "faint"})
    best, most = None, 0.0
    for laser in ("red", "green", "blue") if parameters.laser == "auto" else (parameters.searched_laser,):
        line = faint.model_copy(update={"laser": laser})
        red = np.concatenate([find_stripe(frame, line, background)[:, RED] for frame, background in pairs])
        if len(red) > max(2 * found, LEAST_LINE * len(pairs)) and float(np.sum(red)) > most:
            best, most = line, float(np.sum(red))
    return best


def _kept(frame: Rgb) -> Rgb:
    """A copy that is viewed as words without another one."""
    copy = pixel_buffer(*frame.shape[:2])
    copy[...] = frame
    return copy


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
    pairs = zip(frames, backgrounds or repeat(None), strict=False)
    return _laser(((frame, background) for frame, background in pairs if frame is not None), parameters)


def _laser(pairs: Iterable[Pair], parameters: ExtractionParameters) -> Laser | None:
    lasers: tuple[Laser, ...] = get_args(Laser)
    redness = dict.fromkeys(lasers, 0.0)
    # Squares, since a stripe is strong, and what the room lights is mostly long and weak.
    strength = dict.fromkeys(lasers, 0.0)
    is_grey = True
    best = lasers[0]
    for frame, background in pairs:
        is_grey = is_grey and bool(np.all(np.ptp(frame[::2, ::2], axis=2) <= MOST_CHROMA))
        if not is_grey:
            redness["mono"] = strength["mono"] = 0.0
        for laser in lasers:
            if is_grey == (laser == "mono"):
                red = find_stripe(frame, parameters.model_copy(update={"laser": laser}), background)[:, RED]
                redness[laser] += float(np.sum(red))
                strength[laser] += float(np.sum(red * red))
        best, second = sorted(lasers, key=lambda laser: -strength[laser])[:2]
        if redness[best] > CERTAIN * LEAST and strength[best] > CERTAIN * strength[second] and not is_grey:
            break
    return best if redness[best] >= LEAST else None


def _with_faint_thresholds(pairs: list[Pair], parameters: ExtractionParameters) -> ExtractionParameters:
    """Lower the thresholds where the redness of the stripe is less than `full_redness`, but not into the noise."""
    full = parameters.red_threshold
    if full <= SENSITIVE or parameters.full_redness == 0.0:
        return parameters
    sensitive = _scaled(parameters, SENSITIVE / full)
    found = [find_stripe(frame, sensitive, background)[:, RED] for frame, background in pairs]
    redness = np.concatenate([np.empty(0), *found])
    if not len(redness):
        return parameters
    usual, strongest = (float(level) for level in np.quantile(redness, (0.5, STRONGEST)))
    factor = strongest / parameters.full_redness
    if factor >= 1.0 or usual < MAJORITY * strongest:
        return parameters
    least = max(SENSITIVE, NOISE_SDS * max(_noise(frame, parameters) for frame, _ in pairs))
    return _scaled(parameters, min(max(factor, least / full), 1.0))


def _scaled(parameters: ExtractionParameters, factor: float) -> ExtractionParameters:
    """The same parameters with all thresholds times `factor`."""
    return parameters.model_copy(
        update={
            "red_threshold": max(round(factor * parameters.red_threshold), 1),
            "smallest_contrast": max(factor * parameters.smallest_contrast, 1.0),
            "faintest_contrast": max(factor * parameters.faintest_contrast, 1.0),
        }
    )


def _noise(frame: Rgb, parameters: ExtractionParameters) -> float:
    """Standard deviation of the redness of the half-size image, by the differences of neighbours, grey levels."""
    words = np.ascontiguousarray(as_red(as_words(frame), parameters.searched_laser))
    rows, columns = words.shape[0] // 2, words.shape[1] // 2
    pixels = words.view(np.uint8).reshape(*words.shape, 4)[: 2 * rows, : 2 * columns, :3].astype(np.float32)
    halved: NDArray[np.float32] = pixels.reshape(rows, 2, columns, 2, 3).mean(axis=(1, 3))
    redness = halved[..., 0] - np.maximum(halved[..., 1], halved[..., 2])
    return float(MAD_TO_SD * np.median(np.abs(np.diff(redness, axis=1))) / np.sqrt(2.0))
