"""`footscan why`: old and new side by side."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipelines.cli.main import run_command

Why = Callable[..., tuple[int, str, list[str]]]


@pytest.fixture
def why(capsys: pytest.CaptureFixture[str]) -> Why:
    """Exit status, standard output and the lines of standard error of `footscan why ARGUMENTS`."""

    def run(*arguments: object) -> tuple[int, str, list[str]]:
        capsys.readouterr()
        status = run_command(["why", *map(str, arguments)])
        output = capsys.readouterr()
        return status, output.out, output.err.splitlines()

    return run


def explained(done: tuple[int, str, list[str]]) -> dict[str, Any]:
    """By step."""
    assert (done[0], done[2]) == (0, [])
    return {one["step"]: one for one in json.loads(done[1])["explained"]}


def test_nothing_would_run(done: Any, why: Why) -> None:
    status, printed, messages = why("P0001/S1", "--workflow", done.workflow)
    assert (status, messages) == (0, [])
    assert re.fullmatch(
        r"P0001/S1: nothing would run; last result: \S+, [0-9a-f]{12} of [-0-9]{10} [:0-9]{8}\n", printed
    )
    found = json.loads(why("P0001/S1", "--workflow", done.workflow, "--json")[1])
    assert (found["steps"], found["to_run"], found["explained"]) == (21, 0, [])
    assert f"last result: {found['last']['step']}, " in printed
    assert len(found["last"]["digest"]) == 64
    named = explained(why("P0001/S1", "clean", "--workflow", done.workflow, "--json"))
    assert (named["clean"]["state"], named["clean"]["changes"]) == ("hit", [])
    assert len(named["clean"]["last"]["digest"]) == 64


def test_a_parameter(done: Any, why: Why) -> None:
    done.set_parameters("{extraction: {red_threshold: 20}, outliers: {z_mm: [-1, 100]}}")
    found = explained(why(done.scan, "--workflow", done.workflow, "--json"))
    change = {"what": "parameter", "name": "red_threshold", "step": None, "old": "18", "new": "20"}
    assert found["extract-1"]["changes"] == found["extract-5"]["changes"] == [change]
    assert (found["extract-1"]["state"], found["clean"]["state"]) == ("miss", "waits")
    # The known inputs of a waiting step are reported.
    assert [change["name"] for change in found["clean"]["changes"]] == ["z_mm"]
    assert found["fuse"]["changes"] == []
    assert "ingest-1" not in found
    _, printed, _ = why("P0001/S1", "extract", "--workflow", done.workflow)
    assert printed.startswith("extract-1, extract-5: parameter red_threshold changed\n")
    assert "│ parameter red_threshold │        18 │  20 │" in printed


def test_an_input_that_is_a_result_names_its_step(done: Any, why: Why, monkeypatch: pytest.MonkeyPatch) -> None:
    from pipelines.engine import run as engine_run

    done.set_parameters("{outliers: {z_mm: [-1, 30]}}")
    original = engine_run.execute

    def interrupted(step: Any, *others: Any, **_: Any) -> Any:
        if step.kind == "orient":
            raise KeyboardInterrupt
        return original(step, *others)

    with monkeypatch.context() as patch:
        patch.setattr(engine_run, "execute", interrupted)
        with pytest.raises(KeyboardInterrupt):
            done.run()
    [change] = explained(why("P0001/S1", "orient", "--workflow", done.workflow, "--json"))["orient"]["changes"]
    assert (change["name"], change["step"]) == ("fused", "P0001/S1/fuse")
    assert len(change["old"]) == len(change["new"]) == 64
    assert "input fused (result of P0001/S1/fuse)" in why("P0001/S1", "orient", "--workflow", done.workflow)[1]


def test_a_value_line_by_line(done: Any, why: Why) -> None:
    document = done.scan / "scan.yaml"
    document.write_text(document.read_text().replace("step_mm: 10.0", "step_mm: 11.0"))
    [change] = explained(why("P0001/S1", "map-5", "--workflow", done.workflow, "--json"))["map-5"]["changes"]
    assert (change["what"], change["name"]) == ("input", "travel")
    assert [' "step_mm": 10.0', ' "step_mm": 11.0'] in change["lines"]
    assert '"step_mm": 11.0' in why("P0001/S1", "--workflow", done.workflow)[1]


def test_code(done: Any, why: Why, monkeypatch: pytest.MonkeyPatch) -> None:
    from pipelines.engine.actions import code

    original = code._text
    monkeypatch.setattr(code, "_text", lambda name, state: original(name, state).replace("def fuse(", "def fuse_all("))
    monkeypatch.setattr(code, "_remembered", dict)
    monkeypatch.setattr(code, "_save_memory", lambda: None)
    for known in (code._IDENTITIES.clear, code._source.cache_clear):
        known()
    try:
        found = explained(why("P0001/S1", "fuse", "--workflow", done.workflow, "--json"))
        printed = why("P0001/S1", "fuse", "--workflow", done.workflow)[1]
    finally:
        for known in (code._IDENTITIES.clear, code._source.cache_clear):
            known()
    [change] = found["fuse"]["changes"]
    assert change["what"] == "code"
    assert any(old.startswith("def fuse(") and new.startswith("def fuse_all(") for old, new in change["lines"])
    assert "def fuse_all(" in printed


def test_never_run_and_without_a_workflow(archive: Any, done: Any, why: Why, tmp_path: Path) -> None:
    found = explained(why("P0001/S1", "--workflow", archive.workflow, "--json"))
    assert len(found) == 21
    assert (found["ingest-1"]["reason"], found["ingest-1"]["last"]) == ("never run", None)
    options = ("--calibration", done.root / "calibration.json", "--out", done.root / "results")
    assert why(done.scan, *options)[1].startswith("P0001/S1: nothing would run")
    assert why(done.scan, *options[:2], "--out", tmp_path / "new")[1].splitlines()[0] == "ingest-1, ingest-5: never run"


def test_a_remembered_failure(archive: Any, why: Why, monkeypatch: pytest.MonkeyPatch) -> None:
    from pipelines.steps import measure
    from schemas.base.errors import Finding

    def none(*_: object) -> bytes:
        raise Finding("no foot in the surface")

    monkeypatch.setattr(measure, "run", none)
    archive.run()
    found = explained(why("P0001/S1", "measure", "--workflow", archive.workflow, "--json"))["measure"]
    assert (found["state"], found["last"]["problem"]) == ("hit", "no foot in the surface")
    behind = explained(why("P0001/S1", "report", "--workflow", archive.workflow, "--json"))["report"]
    assert (behind["state"], behind["reason"], behind["last"]) == ("hit", "fails with a step before it", None)


def test_wrong_use_is_one_line(finished: Path, why: Why, tmp_path: Path) -> None:
    workflow = finished / "workflow.yaml"
    for arguments, expected in (
        (("P0001/S1", "clear", "--workflow", workflow), "footscan: clear: no such step, expected one of ingest, "),
        (("P0001/S2", "--workflow", workflow), "footscan: P0001/S2: no such scan in the workflow's archive"),
        ((tmp_path, "--out", tmp_path / "out"), f"footscan: {tmp_path}/scan.yaml: no such file"),
        (("P0001/S1", "--workflow", tmp_path / "w.yaml"), f"footscan: {tmp_path}/w.yaml: no such file"),
        (("x", "--workflow", workflow, "--out", "y"), "footscan: --workflow: and --out exclude each other"),
        (("x", "--calibration", "y"), "footscan: --calibration: goes with --out"),
    ):
        status, printed, lines = why(*arguments)
        assert (status, printed, len(lines)) == (2, "", 1)
        assert lines[0].startswith(expected)
