"""The examples in the docstrings of meshes run."""

import doctest
from importlib import import_module

import pytest

MODULES = [
    "buckets",
    "cells",
    "formats.polygons",
    "mesh",
    "rigid_transform",
    "sampling",
    "sections",
    "topology",
    "voxels",
]


@pytest.mark.parametrize("module", MODULES)
def test_examples(module: str) -> None:
    results = doctest.testmod(import_module(f"footscan.mesh.{module}"))
    assert results.attempted > 0
    assert results.failed == 0
