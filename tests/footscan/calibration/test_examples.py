"""The examples in the docstrings of the calibration's modules run."""

import doctest
from importlib import import_module

import pytest

MODULES = [
    *("models.fit", "models.homography", "models.maps", "models.observations", "models.polynomial"),
    *("models.pose", "models.region", "models.selection", "chart.plane_fit", "chart.quadratic"),
    *("capture.edge_points", "capture.from_capture", "capture.lines", "capture.reference", "capture.stripe_arrays"),
]


@pytest.mark.parametrize("module", MODULES)
def test_examples(module: str) -> None:
    results = doctest.testmod(import_module(f"footscan.calibration.{module}"))
    assert results.attempted
    assert not results.failed
