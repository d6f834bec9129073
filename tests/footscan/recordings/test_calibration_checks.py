"""Which check a scan has, and what it says of the scan's cameras."""

import datetime
from pathlib import Path

import pytest
from checked import made_check

from footscan.recordings.calibration_checks import check_of_scan, checks_of, for_cameras
from footscan.recordings.scans import RecordedScan, read_scan
from schemas.base.errors import RefusedInput
from schemas.calibration_check import CalibrationCheck, ScanCheck

DAY = datetime.date(2026, 11, 24)
STEADY, DRIFTED = {1: 0.03, 5: 0.02}, {1: 0.03, 5: 0.414}


@pytest.fixture
def calibration(tmp_path: Path) -> Path:
    path = tmp_path / "calibration.json"
    path.write_text("{}")
    return path


def a_scan(tmp_path: Path, day: str | None, carried: CalibrationCheck | None = None) -> RecordedScan:
    folder = tmp_path / "P1/S1"
    folder.mkdir(parents=True)
    if carried is not None:
        (folder / "check.json").write_text(carried.model_dump_json())
    (folder / "scan.yaml").write_text(
        "{format: footscan.scan/1, patient: P1, scan: S1, side: right, travel: {start_mm: 0, step_mm: 2},\n"
        + (f"date: {day},\n" if day else "")
        + ("calibration_check: check.json,\n" if carried else "")
        + "cameras: [{id: 1, file: a.avi}, {id: 5, file: b.avi}]}\n"
    )
    return read_scan(folder)


def test_only_the_cameras_of_the_scan_matter(calibration: Path) -> None:
    check = made_check(calibration, "2026-11-22T09:00:00+01:00", {**STEADY, 3: 0.9, 7: None})
    steady = for_cameras(check, {1, 5}, DAY)
    assert steady == ScanCheck(checked=datetime.date(2026, 11, 22), age_days=2, largest_mm=0.03)
    assert steady.doubt is None
    moved = for_cameras(check, {1, 3, 7, 8}, None)
    assert (moved.age_days, moved.largest_mm, moved.drifted) == (None, 0.9, [3])
    assert moved.unseen == [7, 8]
    assert moved.doubt == (
        "camera 3 had moved by 0.90 mm when the calibration was checked on 2026-11-22: calibrate anew; "
        "cameras 7 and 8 could not be judged when the calibration was checked on 2026-11-22: check again"
    )
    assert moved.summary() == "checked on 2026-11-22: camera 3 had moved, cameras 7 and 8 could not be judged"
    several = for_cameras(
        made_check(calibration, "2026-11-22T09:00:00+01:00", {1: 0.3, 2: 0.5, 3: 0.1}), {1, 2, 3}, DAY
    )
    assert several.doubt is not None
    assert several.doubt.startswith("cameras 1 and 2 had moved by up to 0.50 mm when")


def test_no_camera_of_the_scan_was_judged(calibration: Path) -> None:
    check = for_cameras(made_check(calibration, "2026-11-22T09:00:00+01:00", {7: None}), {7}, DAY)
    assert (check.largest_mm, check.drifted, check.unseen) == (None, [], [7])
    assert check.summary() == "checked on 2026-11-22, 2 days before the scan: camera 7 could not be judged"


@pytest.mark.parametrize(
    ("day", "expected"),
    [
        ("2026-11-22", None),
        ("2026-11-23", ("2026-11-23", 0, [5])),
        ("2026-11-24", ("2026-11-23", 1, [5])),
        ("2026-11-25", ("2026-11-25", 0, [])),
        ("2026-12-25", ("2026-11-25", 30, [])),
        (None, ("2026-11-25", None, [])),
    ],
)
def test_a_scan_has_the_nearest_check_up_to_its_day(
    calibration: Path, tmp_path: Path, day: str | None, expected: tuple[str, int | None, list[int]] | None
) -> None:
    """The day is that of the scanner's clock, not of universal time: the first check was made on the 22nd there."""
    checks = [
        made_check(calibration, "2026-11-23T00:30:00+02:00", DRIFTED),
        made_check(calibration, "2026-11-25T08:00:00+02:00", STEADY),
    ]
    digest = checks[0].calibration_sha256
    check = check_of_scan(a_scan(tmp_path, day), digest, checks)
    found = None if check is None else (str(check.checked), check.age_days, check.drifted)
    assert found == expected


def test_the_check_that_a_scan_carries_comes_first(calibration: Path, tmp_path: Path) -> None:
    carried = made_check(calibration, "2026-11-24T08:00:00+01:00", DRIFTED)
    later = made_check(calibration, "2026-11-24T12:00:00+01:00", STEADY)
    scan = a_scan(tmp_path, "2026-11-24", carried)
    check = check_of_scan(scan, carried.calibration_sha256, [later])
    assert check is not None
    assert check.drifted == [5]


def test_a_carried_check_of_another_calibration_does_not_count(calibration: Path, tmp_path: Path) -> None:
    carried = made_check(calibration, "2026-11-24T08:00:00+01:00", DRIFTED)
    scan = a_scan(tmp_path, "2026-11-24", carried)
    calibration.write_text('{"made": "anew"}')
    check = made_check(calibration, "2026-11-24T09:00:00+01:00", STEADY)
    assert check_of_scan(scan, check.calibration_sha256, []) is None
    anew = check_of_scan(scan, check.calibration_sha256, [check])
    assert anew is not None
    assert anew.doubt is None


def test_a_carried_check_that_is_missing_or_damaged_is_refused(calibration: Path, tmp_path: Path) -> None:
    scan = a_scan(tmp_path, "2026-11-24", made_check(calibration, "2026-11-24T08:00:00+01:00", DRIFTED))
    file = scan.folder / "check.json"
    file.write_text(file.read_text()[:-9])
    with pytest.raises(RefusedInput, match=r"check\.json: expected a JSON document"):
        check_of_scan(scan, "0" * 64, [])
    file.unlink()
    with pytest.raises(RefusedInput, match=r"check\.json: no such file"):
        check_of_scan(scan, "0" * 64, [])


def test_checks_in_a_folder_that_does_not_exist_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RefusedInput, match="cannot be listed"):
        checks_of(tmp_path / "missing/calibration.json", "0" * 64)
