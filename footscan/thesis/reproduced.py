"""The tables of the thesis, computed anew from its control points."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chart.chart import Chart
from footscan.calibration.chart.quadratic import ORDER, QuadraticFit, fit_quadratic, r_squared
from footscan.calibration.models.polynomial import design_matrix
from footscan.thesis.printed import TERMS, PrintedCoefficient, printed_charts, printed_coefficients

Floats = NDArray[np.float64]


class Coefficient(NamedTuple):
    """A printed coefficient beside that of the least-squares fit."""

    printed: PrintedCoefficient
    alpha_y: float
    alpha_z: float

    @property
    def agrees(self) -> bool:
        """True if the fit rounds to what is printed."""
        own = (self.alpha_y, self.alpha_z)
        return [round(value, self.printed.decimals) for value in own] == [self.printed.alpha_y, self.printed.alpha_z]


class CameraFit(NamedTuple):
    """The quadratic of one camera at its own control points (Appendices A and B), cm."""

    chart: Chart
    fit: QuadraticFit
    observed: Floats
    """(5, 2) Y and Z with the exact coefficients"""
    observed_rounded: Floats
    """(5, 2) Y and Z with coefficients rounded to `decimals`"""
    r2_rounded: tuple[float, float]
    """Coefficients of determination of Y and Z with rounded coefficients"""


def coefficients() -> list[Coefficient]:
    """Table 4-3: each printed row beside the fit to Table 4-2.

    >>> all(row.agrees for row in coefficients())
    True
    """
    fits = {camera: fit_quadratic(chart) for camera, chart in printed_charts().items()}
    rows = []
    for printed in printed_coefficients():
        fit, k = fits[printed.camera], TERMS.index(printed.term)
        rows.append(Coefficient(printed, fit.alpha_y[k], fit.alpha_z[k]))
    return rows


def camera_fits() -> list[CameraFit]:
    """The fits of all cameras, with exact coefficients and with those that are printed.

    >>> first = camera_fits()[0]
    >>> first.observed_rounded[:, 0].round(4).tolist(), round(100 * first.r2_rounded[0], 2)
    ([4.9032, 4.6643, 1.4752, 1.0706, -3.1572], 92.17)
    """
    decimals = {row.camera: row.decimals for row in printed_coefficients()}
    return [_fit(chart, decimals[camera]) for camera, chart in printed_charts().items()]


def _fit(chart: Chart, decimals: int) -> CameraFit:
    fit = fit_quadratic(chart)
    alpha = np.column_stack([fit.alpha_y, fit.alpha_z])
    design = design_matrix(chart.pixels[:, 0], chart.pixels[:, 1], ORDER)
    rounded = design @ np.round(alpha, decimals)
    r2 = [r_squared(chart.world[:, 1 + axis], rounded[:, axis]) for axis in (0, 1)]
    return CameraFit(chart, fit, design @ alpha, rounded, (r2[0] or 0.0, r2[1] or 0.0))
