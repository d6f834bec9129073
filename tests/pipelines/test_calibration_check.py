"""Checks beside a calibration: which one counts, and that none is lost."""

import datetime
from pathlib import Path

import pytest

from footscan.calibration.checks.drift import Drift
from footscan.recordings.calibration_checks import check_path, checks_of
from pipelines.calibration_check import check_document, check_of, store_check
from pipelines.engine.files.digest import sha256
from pipelines.recordings.captures import RecordedCapture
from schemas.base.errors import Fault, RefusedInput
from schemas.calibration_check import CalibrationCheck, CameraCheck
from schemas.reference import Capture, ReferenceObject

STEADY = Drift(1, "steady", 812, (0.01, -0.02), 0.03, 0.11)
DRIFTED = Drift(3, "drifted", 640, (0.02, 0.4), 0.41, 0.6)
MORNING = datetime.datetime(2026, 11, 24, 8, 15, 2, tzinfo=datetime.timezone(datetime.timedelta(hours=1)))


@pytest.fixture
def calibration(tmp_path: Path) -> Path:
    """A file; no check depends on what a calibration says."""
    path = tmp_path / "calibration.json"
    path.write_text("{}")
    return path


@pytest.fixture
def capture(tmp_path: Path) -> RecordedCapture:
    folder = tmp_path / "capture"
    folder.mkdir()
    for name in ("capture.yaml", "reference.yaml", "cam1.avi"):
        (folder / name).write_text(name)
    document = Capture.model_validate(
        {
            "format": "footscan.capture/1", "reference": "reference.yaml", "x_mm": 0.0,
            "cameras": [{"id": 1, "file": "cam1.avi"}],
        }
    )  # fmt: skip
    profile = [[-20.0, 0.0], [20.0, 0.0], [0.0, 50.0]]
    reference = ReferenceObject(format="footscan.reference/1", profile_mm=profile, placements_mm=[[0.0, 0.0]])
    return RecordedCapture(folder, document, reference)


def a_check(calibration: Path, capture: RecordedCapture, hours: float, *drifts: Drift) -> CalibrationCheck:
    checked = MORNING + datetime.timedelta(hours=hours)
    return check_document(sha256(calibration.read_bytes()), capture, drifts or [STEADY], 0.2, checked=checked)


def test_a_document_says_what_was_measured(capture: RecordedCapture) -> None:
    unseen = Drift(7, "not comparable", 12, remark="12 of 90 points lie where data support the calibration")
    beyond = Drift(8, "drifted", 30, (float("inf"), 0.0), float("inf"), float("inf"))
    document = check_document("0" * 64, capture, [STEADY, DRIFTED, unseen, beyond], 0.2, scanner="S1")
    assert (document.verdict, document.scanner, document.tolerance_mm) == ("drifted", "S1", 0.2)
    assert document.cameras[:2] == [
        CameraCheck(camera=1, verdict="steady", points=812, shift_mm=(0.01, -0.02), rms_mm=0.03, worst_mm=0.11),
        CameraCheck(camera=3, verdict="drifted", points=640, shift_mm=(0.02, 0.4), rms_mm=0.41, worst_mm=0.6),
    ]
    assert [(camera.verdict, camera.reason) for camera in document.cameras[2:]] == [
        ("unseen", "not comparable (12 of 90 points lie where data support the calibration)"),
        ("unseen", "the map leads to no place in mm"),
    ]
    digests = {source.name: source.sha256 for source in document.sources}
    assert digests == {name: sha256(name.encode()) for name in ("capture.yaml", "reference.yaml", "cam1.avi")}
    assert document.checked.utcoffset() is not None


def test_the_last_check_counts_and_earlier_ones_are_kept(calibration: Path, capture: RecordedCapture) -> None:
    assert check_of(calibration) is None
    first, second = a_check(calibration, capture, 0, DRIFTED), a_check(calibration, capture, 3)
    assert store_check(calibration, first) == check_path(calibration) == calibration.with_name("calibration.check.json")
    store_check(calibration, first)
    store_check(calibration, second)
    assert check_of(calibration) == second
    assert checks_of(calibration, sha256(b"{}")) == [first, second]
    assert sorted(path.name for path in calibration.parent.glob("*.check*")) == [
        "calibration.check-20261124T071502Z.json",
        "calibration.check.json",
    ]


def test_a_check_of_another_calibration_does_not_count(calibration: Path, capture: RecordedCapture) -> None:
    store_check(calibration, a_check(calibration, capture, 0, DRIFTED))
    calibration.write_text('{"made": "anew"}')
    assert check_of(calibration) is None
    store_check(calibration, a_check(calibration, capture, 3))
    calibration.write_text("{}")
    former = check_of(calibration)
    assert former is not None
    assert former.verdict == "drifted"


def test_a_check_of_a_neighbour_does_not_count(calibration: Path, capture: RecordedCapture) -> None:
    store_check(calibration.with_name("calibration-2.json"), a_check(calibration, capture, 0))
    store_check(calibration.with_name("calibration.check.json"), a_check(calibration, capture, 0))
    assert check_of(calibration) is None


def test_a_link_to_a_calibration_has_the_checks_of_the_file(calibration: Path, capture: RecordedCapture) -> None:
    link = calibration.parent / "elsewhere" / "linked.json"
    link.parent.mkdir()
    link.symlink_to(calibration)
    assert store_check(link, a_check(link, capture, 0, DRIFTED)) == check_path(calibration)
    assert check_of(link) == check_of(calibration) is not None


def test_a_damaged_check_is_refused_and_kept(calibration: Path, capture: RecordedCapture) -> None:
    path = store_check(calibration, a_check(calibration, capture, 0))
    damaged = path.read_text().replace("steady", "stead")
    path.write_text(damaged)
    for refused in (lambda: check_of(calibration), lambda: store_check(calibration, a_check(calibration, capture, 1))):
        with pytest.raises(RefusedInput, match=r"calibration\.check\.json: (verdict|cameras\.0\.verdict): .*'stead'"):
            refused()
    assert path.read_text() == damaged


def test_a_folder_that_takes_no_file_is_a_fault(calibration: Path, capture: RecordedCapture) -> None:
    elsewhere = calibration / "calibration.json"  # below a file: nobody may write there, root included
    with pytest.raises(Fault, match=r"calibration\.check\.json: cannot be written"):
        store_check(elsewhere, a_check(calibration, capture, 0))
