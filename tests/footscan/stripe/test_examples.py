"""The examples in the docstrings of the stripe's modules run."""

import doctest
from importlib import import_module

import pytest


@pytest.mark.parametrize(
    "module", ["centre", "chain", "clutter", "extract", "film", "loop_parameters", "redness", "ridge", "smoothing"]
)
def test_examples(module: str) -> None:
    results = doctest.testmod(import_module(f"footscan.stripe.{module}"))
    assert results.attempted
    assert not results.failed
