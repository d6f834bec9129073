"""A camera moves, the calibration is checked, and scans say what rests on it: the commands as a user gives them."""

import datetime
import json
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import pytest
from shared_folders import MadeOnce

Footscan = Callable[..., CompletedProcess[str]]
MOVED_MM = 0.41


@pytest.fixture(scope="module")
def store(made_once: MadeOnce) -> Path:
    """Results that the checks of these tests share: the films of the capture are extracted once."""
    return made_once("checked", lambda folder: folder.mkdir())


def move_camera(calibration: Path, camera: int) -> None:
    """Make a calibration one of a time when the camera stood elsewhere: its map says `MOVED_MM` more in Z."""
    document = json.loads(calibration.read_text())
    matrix = document["cameras"][camera - 1]["map"]["matrix"]
    for term in range(3):
        matrix[3 + term] += MOVED_MM * [*matrix[6:], 1.0][term]  # Z w + MOVED_MM w
    calibration.write_text(json.dumps(document))


def document_of(bench: Path, name: str) -> dict[str, Any]:
    return dict(json.loads((bench / "results/P0001/small" / name).read_text()))


def statuses_of(bench: Path) -> set[str]:
    return {measure["status"] for measure in document_of(bench, "measures.json")["measures"].values()}


def test_a_camera_that_had_moved_makes_the_measures_uncertain(footscan: Footscan, bench: Path, store: Path) -> None:
    assert "ok" in statuses_of(bench)
    calibration = bench / "calibration.json"
    move_camera(calibration, 3)
    done = footscan("calibrate", "check", calibration, bench / "capture", "--cache", store)
    assert done.returncode == 1
    assert f"{calibration}: does not hold: camera 3 is off by 0.41 mm; 0.2 mm are allowed" in done.stderr
    assert f"{bench / 'calibration.check.json'}: the verdict, which scans carry from now on" in done.stderr
    done = footscan("run", bench / "workflow.yaml")
    assert done.returncode == 0, done.stderr
    check = document_of(bench, "quality.json")["calibration_check"]
    sentence = f"camera 3 had moved by 0.41 mm when the calibration was checked on {check['checked']}: calibrate anew"
    assert abs((datetime.date.today() - datetime.date.fromisoformat(check["checked"])).days) <= 1
    measures = document_of(bench, "measures.json")
    assert measures["doubts"] == [sentence]
    length = measures["measures"]["foot_length"]
    assert (length["status"], length["note"].partition("; ")[0]) == ("uncertain", sentence)
    assert statuses_of(bench) <= {"uncertain", "incomplete"}
    assert f"C{sentence[1:]}." in (bench / "results/P0001/small/report.html").read_text()


def test_a_steady_check_leaves_the_measures_as_they_are(footscan: Footscan, bench: Path, store: Path) -> None:
    before = document_of(bench, "measures.json")
    done = footscan("calibrate", "check", bench / "calibration.json", bench / "capture", "--cache", store)
    assert done.returncode == 0, done.stderr
    done = footscan("run", bench / "workflow.yaml")
    assert done.returncode == 0, done.stderr
    assert done.stderr.splitlines()[0] == "3 of 40 steps to run"
    check = document_of(bench, "quality.json")["calibration_check"]
    assert (check["drifted"], check["unseen"]) == ([], [])
    assert 0.0 < check["largest_mm"] < 0.2
    assert document_of(bench, "measures.json") == before
    assert before["doubts"] == []
    words = f"checked on {check['checked']}: every camera was within {check['largest_mm']:.2f} mm"
    assert words in (bench / "results/P0001/small/report.html").read_text()


def test_a_check_that_is_not_recorded_changes_nothing(footscan: Footscan, bench: Path, store: Path) -> None:
    move_camera(bench / "calibration.json", 3)
    done = footscan(
        "calibrate", "check", bench / "calibration.json", bench / "capture", "--cache", store, "--no-record"
    )
    assert done.returncode == 1
    assert "the verdict, which scans carry" not in done.stderr
    assert list(bench.glob("*.check*")) == []


def test_a_verdict_that_cannot_be_written_is_said_and_its_figures_are_printed(
    footscan: Footscan, bench: Path, store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_only(path: Path, data: bytes) -> None:
        if path.is_relative_to(bench):
            raise PermissionError(13, "Permission denied")
        replace(path, data)

    from pipelines.engine.files import atomic

    replace = atomic._replace
    monkeypatch.setattr(atomic, "_replace", read_only)
    done = footscan("calibrate", "check", bench / "calibration.json", bench / "capture", "--cache", store, "--json")
    assert done.returncode == 3
    assert json.loads(done.stdout)["verdict"] == "steady"
    assert "holds; every camera is within 0.2 mm" in done.stderr
    problem = f"footscan: {bench / 'calibration.check.json'}: cannot be written (Permission denied)"
    assert done.stderr.splitlines()[-1] == problem
