"""The examples in the docstrings of measuring run. `any_mesh` is tested with the Python interface."""

import doctest
from importlib import import_module

import pytest

MODULES = [
    "foot_landmarks",
    "girths",
    "hull",
    "landmarks.dense_points",
    "landmarks.extreme",
    "landmarks.plantar",
    "landmarks.polynomial",
    "outline",
    "pose",
    "quantity",
    "roughness",
]


@pytest.mark.parametrize("module", MODULES)
def test_examples(module: str) -> None:
    results = doctest.testmod(import_module(f"footscan.measure.{module}"))
    assert results.attempted > 0
    assert results.failed == 0
