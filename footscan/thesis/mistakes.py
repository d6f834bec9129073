"""What is wrong in the print of the thesis, with the reason and the figures that show it."""

import math
from typing import NamedTuple

import numpy as np

from footscan.thesis.printed import (
    BLOCK_ACCURACY_MM,
    BLOCK_MM,
    CLOTH_MM,
    FOOT_MAX_MM,
    FOOT_MEAN_MM,
    R2_PERCENT,
    SCANNED_BLOCK_MM,
    WITHIN_MM,
    WITHIN_SHARE,
)
from footscan.thesis.reproduced import camera_fits


class Mistake(NamedTuple):
    """One mistake of the print."""

    place: str
    printed: str
    reason: str


def mistakes() -> list[Mistake]:
    """The mistakes, in the order of the print; all figures in them are computed."""
    fits = camera_fits()
    first = fits[0]
    exact = 100.0 * (first.fit.r2_y or 0.0)
    worst = min(fits, key=lambda camera: min(camera.r2_rounded))
    at_border = [
        f"P{k + 1} of camera {camera.chart.camera} at ({i:g}, {j:g})"
        for camera in fits
        for k, (i, j) in enumerate(camera.chart.pixels.tolist())
        if i >= camera.chart.size.px[0] or j >= camera.chart.size.px[1]
    ]
    errors = [found - true for true, found in zip(BLOCK_MM, SCANNED_BLOCK_MM, strict=True)]
    return [
        Mistake(
            "Equations 4.10, 4.11",
            "a quadratic of six coefficients from five control points",
            "Five equations do not determine six unknowns. MATLAB's backslash returns the basic solution, whose "
            "constant term is zero, and the polynomial passes through its points by construction: the residual says "
            "nothing of the error between them. With one point left out, it misses that point by 5 to 857 mm "
            "(docs/calibration.md).",
        ),
        Mistake(
            "Appendix A",
            f"R² = {R2_PERCENT:g} % for the Y of camera 1",
            f"It is the effect of rounding the coefficients to five decimals, not of the model: with exact ones R² is "
            f"{exact:.2f} %. With those that are printed to three decimals for the other cameras, R² falls to "
            f"{100.0 * min(worst.r2_rounded):.0f} % (camera {worst.chart.camera}), and points are off by up to "
            f"{10.0 * float(np.abs(worst.observed_rounded - worst.chart.world[:, 1:]).max()):.0f} mm.",
        ),
        Mistake(
            "Table 4-2",
            ", ".join(at_border),
            "Columns of a picture of 640 × 480 are numbered from 0 to 639. These corners were clicked on the border "
            "of the picture, and may lie beyond it. P5 of camera 5 does not fit the plane seen by a pinhole: its "
            "residual is four times that of the other cameras.",
        ),
        Mistake(
            "Appendix B",
            "headings of observed and given coordinates",
            "They are exchanged: control points are given in whole centimetres, and what is observed is not.",
        ),
        Mistake(
            "Table 6-1",
            f"an accuracy of ±{BLOCK_ACCURACY_MM:g} mm",
            f"The block's dimensions in the same table are off by {', '.join(f'{error:.1f}' for error in errors)} mm.",
        ),
        Mistake(
            "Table 6-1",
            f"the block of {' × '.join(f'{side:g}' for side in BLOCK_MM)} mm as the truth",
            f"A cloth of {CLOTH_MM:g} mm lay on the block, and was scanned with it: on the top it adds {CLOTH_MM:g} mm "
            f"to a height that was found {errors[2]:.1f} mm too great, and on two sides twice as much.",
        ),
        Mistake(
            "Table 6-2",
            "the standard deviation of the distances",
            f"Distances from 0 to {FOOT_MAX_MM:g} mm whose mean is {FOOT_MEAN_MM:g} mm have a standard deviation of "
            f"{largest_deviation(FOOT_MEAN_MM, FOOT_MAX_MM):.2f} mm at most (R. Bhatia, C. Davis, American "
            "Mathematical Monthly 107(4), 2000). What is printed is more.",
        ),
        Mistake(
            "Table 6-2",
            f"{100.0 * WITHIN_SHARE:g} % of the points within {WITHIN_MM:g} mm",
            "Of which surface, and to which, is not said. From the scan to the truth it shows the error of what was "
            "scanned, from the truth to the scan also what is missing. Both are given beside it.",
        ),
    ]  # fmt: skip


def largest_deviation(mean: float, largest: float) -> float:
    """The greatest standard deviation of values from 0 to `largest` with this mean.

    >>> round(largest_deviation(0.35, 3.1), 3)
    0.981
    """
    return math.sqrt(mean * (largest - mean))
