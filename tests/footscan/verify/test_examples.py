"""The examples in the docstrings of verification run."""

import doctest
from importlib import import_module

import pytest

MODULES = [
    "ambiguity",
    "compare",
    "distances",
    "histogram",
    "icp",
    "shapes.fitting",
    "shapes.stripe_ends",
]


@pytest.mark.parametrize("module", MODULES)
def test_examples(module: str) -> None:
    results = doctest.testmod(import_module(f"footscan.verify.{module}"))
    assert results.attempted > 0
    assert results.failed == 0
