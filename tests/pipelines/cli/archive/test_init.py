"""`footscan init`: a workflow for scans that are there, and for films in a layout of their own."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from pipelines.archive.workflow_file import read_workflow
from pipelines.cli.main import run_command
from pipelines.init.film_names import FilmPattern
from schemas.base.errors import RefusedInput
from schemas.workflow import Workflow


def initialised(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    capsys.readouterr()
    status = run_command(["init", *map(str, arguments)])
    said = capsys.readouterr()
    return status, said.out, said.err


@pytest.fixture
def films(pristine: Path, write_scan: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two feet of a person, filmed by another program: no scan.yaml, and folders of its own."""
    document = (pristine / "archive/P0001/S1/scan.yaml").read_text()
    for side, broader in (("R", 1.0), ("L", 1.1)):
        write_scan(tmp_path / "made" / side, document, broader)
        for camera in (1, 5):
            film = tmp_path / f"films/Meier, A./20261120_{side}/kamera{camera:02d}.avi"
            film.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(tmp_path / "made" / side / f"cam{camera}.avi", film)
    shutil.copy(pristine / "calibration.json", tmp_path / "films/calibration.json")
    monkeypatch.chdir(tmp_path)
    return tmp_path / "films"


PATTERN = "{patient}/{date}_{side}/kamera{camera}.avi"


def test_from_films_to_the_table(films: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, said, _ = initialised(capsys, films, "--films", PATTERN, "--step-mm", 10)
    assert status == 0
    assert said.splitlines()[0] == "workflow.yaml: 2 scans of 1 patient, up to 2 cameras, from 2026-11-20 to 2026-11-20"
    document = yaml.safe_load((films / "Meier, A./20261120_R/scan.yaml").read_text())
    assert document == {
        "format": "footscan.scan/1", "patient": "Meier_A", "scan": "2026-11-20-R", "side": "right",
        "date": "2026-11-20", "travel": {"start_mm": 0.0, "step_mm": 10.0},
        "cameras": [{"id": 1, "file": "kamera01.avi"}, {"id": 5, "file": "kamera05.avi"}],
    }  # fmt: skip
    assert read_workflow(Path("workflow.yaml")) == Workflow(
        format="footscan.workflow/1", archive=["films"], calibration="films/calibration.json", results="results"
    )
    assert run_command(["config", "check"]) == 0
    assert run_command(["run"]) == 0
    capsys.readouterr()
    assert run_command(["results", "--json"]) == 0
    assert {one["scan"] for one in json.loads(capsys.readouterr().out)} == {
        "Meier_A/2026-11-20-R", "Meier_A/2026-11-20-L"
    }  # fmt: skip
    assert initialised(capsys, films)[::2] == (
        2, "footscan: workflow.yaml: is there already, expected another name with --out\n"
    )  # fmt: skip


def test_films_of_several_scans_in_one_folder(films: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flat = films.parent / "flat"
    flat.mkdir()
    (films / "calibration.json").unlink()
    for side in "RL":
        for camera in (1, 5):
            shutil.copy(films / f"Meier, A./20261120_{side}/kamera{camera:02d}.avi", flat / f"7{side}-{camera}.avi")
            shutil.copy(films / f"Meier, A./20261120_{side}/kamera{camera:02d}.avi", flat / f"7{side}-{camera}-off.avi")
    status, _, said = initialised(
        capsys, flat, "--films", "{patient}{side}-{camera}.avi", "--backgrounds", "{patient}{side}-{camera}-off.avi",
        "--step-mm", 10,
    )  # fmt: skip
    assert (status, "2 scans name no calibration and none was found" in said) == (0, True)
    document = yaml.safe_load((flat / "7/L/scan.yaml").read_text())
    assert document["cameras"][0] == {"id": 1, "file": "../../7L-1.avi", "background": "../../7L-1-off.avi"}
    assert (document["patient"], document["scan"], document["side"]) == ("7", "L", "left")
    assert "# calibration: calibration.json   # none was found" in Path("workflow.yaml").read_text()


def test_scans_that_are_there(
    archive: Any, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(archive.root)
    (archive.root / "archive/P0001/S2").mkdir()
    (archive.root / "archive/P0001/S2/scan.yaml").write_text("format: footscan.scan/1\n")
    status, said, problems = initialised(capsys, "archive", "--out", "new.yaml")
    assert (status, said.splitlines()[0]) == (1, "new.yaml: 1 scan of 1 patient, up to 2 cameras")
    assert "S2/scan.yaml: patient: is missing" in problems
    assert read_workflow(Path("new.yaml")).calibration == "calibration.json"


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["nowhere"], "nowhere: no such folder"),
        (["films"], "films: holds no scan.yaml, expected --films"),
        (["films", "--step-mm", "2"], "--films: is missing"),
        (["films", "--films", PATTERN], "--step-mm: is missing"),
        (["films", "--films", "{who}/cam{camera}.avi", "--step-mm", "2"], "--films: no field 'who', expected some of"),
        (["films", "--films", "{patient}/cam.avi", "--step-mm", "2"], "--films: has no {camera}"),
        (["films", "--films", "{patient}/cam{camera}.avi", "--step-mm", "2"], "--films: no path in "),
        (["films", "--films", "{patient}/*/kamera{camera}.avi", "--step-mm", "2"], "are both camera 1 of Meier_A/S1"),
    ],
)
def test_what_cannot_be_understood_is_refused(
    films: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], problem: str
) -> None:
    del films
    status, _, said = initialised(capsys, *arguments)
    assert (status, len(said.splitlines()), problem in said) == (2, 1, True), said
    assert not Path("workflow.yaml").exists()


def test_a_field_that_comes_twice_must_agree() -> None:
    pattern = FilmPattern("{patient}/{patient}_cam{camera}.avi", "--films")
    assert pattern.match("7/7_cam2.avi") == {"patient": "7", "camera": "2"}
    assert pattern.match("7/8_cam2.avi") is None
    with pytest.raises(RefusedInput):
        FilmPattern("cam{camera}.avi", "--films")
