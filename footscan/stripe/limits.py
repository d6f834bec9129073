"""The parameters of the extraction as compiled loops take them."""

from typing import NamedTuple

from schemas.parameters.extraction import ExtractionParameters

METHODS = ("threshold-median", "gravity", "gaussian", "ridge", "fir")
THRESHOLD_MEDIAN, GRAVITY, GAUSSIAN, RIDGE, FIR = range(len(METHODS))


class Limits(NamedTuple):
    """What `ExtractionParameters` say; grey levels and px."""

    red_threshold: int
    saturation: int
    faintest: float
    largest_width: float
    centre_level: float
    method: int


def limits_of(parameters: ExtractionParameters) -> Limits:
    """The part of `parameters` that pixels are held against."""
    return Limits(
        parameters.red_threshold,
        parameters.saturation,
        parameters.faintest_contrast,
        parameters.largest_width_px,
        parameters.centre_level,
        METHODS.index(parameters.centre_method),
    )
