"""The thesis's own figures, read as data: its chart of eight cameras and the coefficients that it prints."""

import csv

import numpy as np
import pytest

from footscan.calibration.chart.chart import Chart
from footscan.calibration.chart.quadratic import fit_quadratic, r_squared
from footscan.calibration.models.polynomial import design_matrix
from footscan.thesis.printed import COEFFICIENTS_FILE, printed_charts

TERMS = ["1", "i", "j", "i^2", "ij", "j^2"]
CHARTS = printed_charts()
with COEFFICIENTS_FILE.open(newline="") as file:
    PRINTED = list(csv.DictReader(file))


def test_table_of_coefficients_is_whole() -> None:
    assert len(PRINTED) == 43
    assert {int(row["camera"]) for row in PRINTED} == set(CHARTS)


@pytest.mark.parametrize("row", PRINTED, ids=lambda row: f"camera {row['camera']} {row['term']}")
def test_printed_coefficients(row: dict[str, str]) -> None:
    fit = fit_quadratic(CHARTS[int(row["camera"])])
    index, decimals = TERMS.index(row["term"]), int(row["decimals"])
    assert round(fit.alpha_y[index], decimals) == float(row["alpha_y"])
    assert round(fit.alpha_z[index], decimals) == float(row["alpha_z"])


def test_observed_y_of_camera_1() -> None:
    """The thesis's appendix: coefficients rounded to five decimals."""
    chart = CHARTS[1]
    alpha = np.round(fit_quadratic(chart).alpha_y, 5)
    observed = design_matrix(chart.pixels[:, 0], chart.pixels[:, 1], 2) @ alpha
    assert np.round(observed, 4).tolist() == [4.9032, 4.6643, 1.4752, 1.0706, -3.1572]
    r2 = r_squared(chart.world[:, 1], observed)
    assert r2 is not None
    assert round(100 * r2, 2) == 92.17


def test_five_points_determine_the_fit() -> None:
    for chart in CHARTS.values():
        fit = fit_quadratic(chart)
        assert fit.determined
        assert fit.remark is not None
        assert "says nothing" in fit.remark
        assert fit.alpha_y[0] == fit.alpha_z[0] == 0.0
        assert fit.r2_y == pytest.approx(1.0, abs=1e-9)
        assert fit.r2_z == pytest.approx(1.0, abs=1e-9)


def chart(pixels: np.ndarray, world: np.ndarray) -> Chart:
    return Chart(1, tuple(f"P{n}" for n in range(len(pixels))), world, "mm", pixels)


def test_many_points_are_ordinary_least_squares() -> None:
    # A known polynomial on a 4 x 4 grid of pixels; a disturbance orthogonal to all second-order terms (third
    # differences -1, 3, -3, 1 along i) must not change it.
    i, j = (a.ravel() for a in np.meshgrid([0.0, 200.0, 400.0, 600.0], [0.0, 150.0, 300.0, 450.0], indexing="ij"))
    alpha = np.array([-40.0, 0.1, 0.2, 1e-5, -2e-5, 3e-5])
    z = np.stack([np.ones_like(i), i, j, i * i, i * j, j * j], axis=1) @ alpha
    disturbance = np.repeat([-1.0, 3.0, -3.0, 1.0], 4)
    fit = fit_quadratic(chart(np.stack([i, j], 1), np.stack([0 * i, 7 + 0 * i, z + disturbance], 1)))
    np.testing.assert_allclose(fit.alpha_z, alpha, rtol=1e-9)
    np.testing.assert_allclose(fit.alpha_y, [7, 0, 0, 0, 0, 0], atol=1e-11)
    assert not fit.determined
    assert fit.remark is None
    assert fit.r2_y is None
    # SSE = 4 (1 + 9 + 9 + 1) = 80
    assert fit.r2_z == pytest.approx(1 - 80 / np.sum((z + disturbance - z.mean()) ** 2), rel=1e-12)
