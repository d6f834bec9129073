"""What is wrong in the print follows from its own figures."""

import numpy as np
import pytest

from footscan.thesis.mistakes import largest_deviation, mistakes
from footscan.thesis.printed import printed_charts
from footscan.thesis.reproduced import camera_fits, coefficients


def test_all_printed_coefficients_are_those_of_the_fit() -> None:
    rows = coefficients()

    assert len(rows) == 43
    assert all(row.agrees for row in rows)
    assert {row.printed.camera for row in rows} == set(printed_charts())


def test_rounded_coefficients_lose_millimetres_and_exact_ones_none() -> None:
    for camera in camera_fits():
        np.testing.assert_allclose(camera.observed, camera.chart.world[:, 1:], atol=1e-9)
        assert camera.fit.r2_y == pytest.approx(1.0)
        assert np.abs(camera.observed_rounded - camera.chart.world[:, 1:]).max() > 0.1
        assert max(camera.r2_rounded) < 1.0


def test_each_mistake_names_place_print_and_reason() -> None:
    found = {mistake.place: mistake for mistake in mistakes()}

    assert all(mistake.printed and mistake.reason for mistake in mistakes())
    assert "P5 of camera 5 at (640, 255)" in found["Table 4-2"].printed
    assert "100.00 %" in found["Appendix A"].reason
    assert "1.2, 2.0, 1.4 mm" in next(m for m in mistakes() if "accuracy" in m.printed).reason


def test_the_greatest_deviation_is_reached_by_two_values() -> None:
    values = np.repeat([0.0, 3.1], [275, 35])

    assert largest_deviation(float(values.mean()), 3.1) == pytest.approx(float(values.std()))
    assert largest_deviation(float(values.mean()), 3.1) > np.append(values, 1.0).std()
