"""`footscan scan` before it films."""

from pathlib import Path

import pytest
from checked import made_check

from pipelines.calibration_check import store_check
from pipelines.cli.main import run_command

RIG = """\
format: footscan.rig/1
scanner: S1
port: no-board
calibration: calibration.json
cameras:
  - {id: 1, device: "http://127.0.0.1:9/1"}
  - {id: 5, device: "http://127.0.0.1:9/5"}
"""
WARNING = (
    "Warning: camera 5 had moved by 0.41 mm when the calibration was checked on 2026-11-24: calibrate anew; the "
    "measures of this scan will be uncertain"
)


@pytest.mark.parametrize("named", [False, True])
@pytest.mark.parametrize(("moved_mm", "first"), [(0.41, WARNING), (0.02, None)])
def test_a_camera_that_had_moved_is_told_before_the_scanner_is_connected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], named: bool, moved_mm: float, first: str | None
) -> None:
    rig, calibration = tmp_path / "rig.yaml", tmp_path / ("own.json" if named else "calibration.json")
    rig.write_text(RIG)
    calibration.write_text("{}")
    store_check(calibration, made_check(calibration, "2026-11-24T08:00:00+01:00", {1: 0.03, 5: moved_mm, 7: 0.9}))
    arguments = ["scan", "P1", "right", "--rig", str(rig), "--out", str(tmp_path / "archive")]
    status = run_command([*arguments, *(("--calibration", str(calibration)) if named else ())])
    *before, last = capsys.readouterr().err.splitlines()
    assert status != 0
    assert "no-board" in last
    assert ([line for line in before if line.startswith("Warning")] or [None]) == [first]
    assert not (tmp_path / "archive").exists()
