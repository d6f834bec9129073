"""The parameters of the extraction in the form that compiled loops take."""

from typing import NamedTuple

from schemas.parameters.extraction import ExtractionParameters

METHODS = ("threshold-median", "gravity", "gaussian", "ridge", "fir")
"""The values of `centre_method`."""
THRESHOLD_MEDIAN, GRAVITY, GAUSSIAN, RIDGE, FIR = range(len(METHODS))
"""Their numbers."""


class LoopParameters(NamedTuple):
    """Values of `ExtractionParameters` that pixels and profiles are compared with, in grey levels and px."""

    red_threshold: int
    saturation: int
    faintest: float
    largest_width: float
    centre_level: float
    method: int


def loop_parameters_of(parameters: ExtractionParameters) -> LoopParameters:
    """Select the limits from `parameters`.

    >>> limits = loop_parameters_of(ExtractionParameters(centre_method="gaussian"))
    >>> limits.method == GAUSSIAN
    True
    """
    return LoopParameters(
        parameters.red_threshold,
        parameters.saturation,
        parameters.faintest_contrast,
        parameters.largest_width_px,
        parameters.centre_level,
        METHODS.index(parameters.centre_method),
    )
