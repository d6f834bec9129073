"""The examples in the docstrings of sizing run."""

import doctest
from importlib import import_module

import pytest


@pytest.mark.parametrize("module", ["readings", "sizes"])
def test_examples(module: str) -> None:
    results = doctest.testmod(import_module(f"footscan.sizing.{module}"))
    assert results.attempted > 0
    assert results.failed == 0
