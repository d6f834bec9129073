"""The examples in the docstrings of the cloud's modules run."""

import doctest
from importlib import import_module

import pytest

MODULES = [
    *("clutter", "colour", "mapping", "normals", "outliers", "planes", "glass", "points", "segments", "uncertainty"),
    *("views", "fusion.agreement", "fusion.fuse", "fusion.motion", "fusion.stripes"),
]


@pytest.mark.parametrize("module", MODULES)
def test_examples(module: str) -> None:
    results = doctest.testmod(import_module(f"footscan.cloud.{module}"))
    assert results.attempted
    assert not results.failed
