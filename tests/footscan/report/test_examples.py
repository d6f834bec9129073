"""The examples in the docstrings of the reports."""

import doctest
from types import ModuleType

import pytest

from footscan.report import colours, markup, sample_frames
from footscan.report.calibration import facts
from footscan.report.scan import coverage


@pytest.mark.parametrize("module", [colours, markup, sample_frames, facts, coverage])
def test_examples(module: ModuleType) -> None:
    results = doctest.testmod(module)
    assert results.attempted
    assert results.failed == 0
