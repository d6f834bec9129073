"""Feet by a few numbers, and the table that comes along."""

from collections.abc import Callable, Mapping
from typing import Any

import pytest

from footscan.sizing.table import read_table
from schemas.feet import Foot
from schemas.sizes import SizeTable

MakeFoot = Callable[..., Foot]


@pytest.fixture(scope="session")
def table() -> SizeTable:
    return read_table()


@pytest.fixture(scope="session")
def make_foot() -> MakeFoot:
    """`make_foot("right", foot_length=270.0, ball_girth={"value": None, "note": "a gap"}, patient="P1")`"""
    return _make_foot


def _make_foot(side: str = "right", **told: Any) -> Foot:
    names = {"patient", "scan", "source", "axis", "finding", "side_note", "posture"}
    measures = {name: _reading(name, value) for name, value in told.items() if name not in names}
    document = {"format": "footscan.measures/1", "unit": "mm", "side": side, "measures": measures}
    return Foot.model_validate(document | {name: told[name] for name in names & told.keys()})


def _reading(name: str, value: float | Mapping[str, Any]) -> dict[str, Any]:
    return {"unit": "mm", "definition": name, **(value if isinstance(value, Mapping) else {"value": value})}
