"""`footscan trace`: down to films, calibration and versions."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines.cli.main import run_command
from pipelines.engine.files.digest import sha256

Trace = Callable[..., tuple[int, str, list[str]]]


@pytest.fixture
def trace(capsys: pytest.CaptureFixture[str]) -> Trace:
    """Exit status, standard output and the lines of standard error of `footscan trace ARGUMENTS`."""

    def run(*arguments: object) -> tuple[int, str, list[str]]:
        capsys.readouterr()
        status = run_command(["trace", *map(str, arguments)])
        output = capsys.readouterr()
        return status, output.out, output.err.splitlines()

    return run


def taken(action: Any, name: str) -> Any:
    return next(one for one in action["inputs"] if one["name"] == name)


def test_a_mesh_down_to_its_films(finished: Path, trace: Trace) -> None:
    mesh = finished / "results/P0001/S1/foot.stl"
    status, printed, messages = trace(mesh, "--json")
    assert (status, messages) == (0, [])
    found = json.loads(printed)
    assert found["digest"] == sha256(mesh.read_bytes())
    actions = found["actions"]
    steps = {action["step"].removeprefix("P0001/S1/") for action in actions.values()}
    chain = {"foot.stl", "surface", "orient", "clean", "heads", "fuse"}
    assert steps == chain | {f"{kind}-{camera}" for kind in ("ingest", "extract", "map") for camera in (1, 5)}
    action = actions[found["made_by"]]
    assert action["result"] == found["digest"]
    for name in ("surface", "oriented", "fused", "clean", "points-5"):
        action = actions[taken(action, name)["made_by"]]
    assert action["step"] == "P0001/S1/map-5"
    assert taken(action, "calibration")["content"]["camera"] == 5
    assert taken(action, "travel")["content"] == {"start_mm": 0.0, "step_mm": 10.0}
    assert action["libraries"]["numpy"] == np.__version__
    ingest = actions[taken(action, "manifest")["made_by"]]
    film = finished / "archive/P0001/S1/cam5.avi"
    digest = sha256(film.read_bytes())
    assert ingest["inputs"] == [{"name": "film", "source": "file", "digest": digest, "place": str(film)}]


@pytest.mark.parametrize("file", ["cloud.ply", "measures.json", "quality.json", "report.html"])
def test_each_file_of_the_results(finished: Path, trace: Trace, file: str) -> None:
    status, printed, _ = trace(finished / "results/P0001/S1" / file)
    assert status == 0
    assert printed.count("P0001/S1/ingest-1") >= 1
    assert str(finished / "archive/P0001/S1/cam1.avi") in printed.replace("\n", "") or "cam1.avi" in printed
    assert f"numpy {np.__version__}" in printed


def test_a_file_elsewhere_with_the_store_named(finished: Path, trace: Trace, tmp_path: Path) -> None:
    copy = Path(shutil.copy(finished / "results/P0001/S1/measures.json", tmp_path / "m.json"))
    status, _, messages = trace(copy)
    problem = "no workflow.yaml and no folder above it leads to its store, expected --cache PLACE"
    assert (status, messages) == (2, [f"footscan: {copy}: {problem}"])
    assert trace(copy, "--cache", finished / "results/.footscan")[0] == 0


def test_the_store_that_the_workflow_names_is_found(done: Any, trace: Trace) -> None:
    """And not what lies beside the results, be it notes on another store or an old one."""
    mesh, notes = done.results / "foot.stl", done.root / "results/.footscan"
    shutil.move(notes, done.root / "elsewhere")
    notes.mkdir()
    (notes / "files.json").touch()
    status, _, messages = trace(mesh)
    assert (status, "expected --cache PLACE" in messages[0]) == (2, True)
    done.workflow.write_text(f"{done.workflow.read_text()}cache: elsewhere\n")
    shutil.copytree(done.root / "elsewhere/latest", notes / "actions")
    assert trace(mesh)[0] == 0


def test_what_no_step_made(done: Any, trace: Trace) -> None:
    changed = done.results / "measures.json"
    changed.write_bytes(changed.read_bytes() + b"\n")
    place = done.root / "results/.footscan"
    status, printed, messages = trace(changed)
    assert (status, printed) == (1, "")
    assert messages == [f"footscan: {changed}: no step made it, as far as {place} knows"]
    status, printed, _ = trace(changed, "--json")
    assert status == 1
    assert (json.loads(printed)["made_by"], json.loads(printed)["actions"]) == (None, {})


def test_results_of_earlier_parameters(done: Any, trace: Trace, tmp_path: Path) -> None:
    earlier = Path(shutil.copy(done.results / "foot.stl", tmp_path / "foot.stl"))
    done.set_parameters("{outliers: {z_mm: [-1, 50]}}")
    done.run()
    found = json.loads(trace(earlier, "--cache", done.root / "results/.footscan", "--json")[1])
    kinds = {action["kind"]: action for action in found["actions"].values()}
    assert kinds["clean"]["parameters"]["values"]["z_mm"] is None
    assert kinds["clean"]["step"] is None
    assert "clean (of an earlier run)" in trace(earlier, "--cache", done.root / "results/.footscan")[1]
    now = json.loads(trace(done.results / "foot.stl", "--json")[1])
    kinds = {action["kind"]: action for action in now["actions"].values()}
    assert kinds["clean"]["parameters"]["values"]["z_mm"] == [-1.0, 50.0]


def test_wrong_use_is_one_line(finished: Path, trace: Trace, tmp_path: Path) -> None:
    mesh = finished / "results/P0001/S1/foot.stl"
    for arguments, expected in (
        ((tmp_path / "x.stl",), "x.stl: no such file"),
        ((tmp_path,), "expected a file"),
        ((mesh, "--cache", tmp_path / "no"), "no: no such folder, expected the store of a run"),
    ):
        status, printed, lines = trace(*arguments)
        assert (status, printed, len(lines)) == (2, "", 1)
        assert expected in lines[0]
