"""`footscan run` shows the warnings of each scan where its results are named."""

import json
from typing import Any

import pytest

from pipelines.cli.archive.run import run


def test_warnings_stand_in_the_terminal_and_in_the_document(done: Any, capsys: pytest.CaptureFixture[str]) -> None:
    warnings = json.loads((done.results / "quality.json").read_bytes())["scan_warnings"]
    assert warnings
    assert run(done.workflow) == 0
    shown = capsys.readouterr()
    assert [line for line in shown.err.splitlines() if line.startswith("P0001/S1: ")] == [
        f"P0001/S1: {warning}" for warning in warnings
    ]
    assert run(done.workflow, as_json=True) == 0
    shown = capsys.readouterr()
    [scan] = json.loads(shown.out)["scans"]
    assert "P0001/S1: " not in shown.err
    assert (scan["scan"], scan["warnings"]) == ("P0001/S1", warnings)
