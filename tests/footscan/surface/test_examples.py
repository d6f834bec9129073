"""The examples in the docstrings of the surface run."""

import doctest
from importlib import import_module

import pytest

MODULES = [
    "ankle",
    "ball_pivoting",
    "collapse",
    "holes",
    "poisson",
    "patch",
    "projection",
    "quality",
    "travel_ends",
]


@pytest.mark.parametrize("module", MODULES)
def test_examples(module: str) -> None:
    results = doctest.testmod(import_module(f"footscan.surface.{module}"))
    assert results.attempted > 0
    assert results.failed == 0
