"""Lets `test_board_*` find their bench; benches for the virtual board's firmware, one as switched on and one homed."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from board_bench import Bench, home


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def homed() -> Bench:
    return home(Bench())
