"""The step that calibrates from a capture, where the capture is not what was filmed."""

import json
from pathlib import Path

import pytest

from pipelines.engine.files.digest import sha256
from pipelines.steps import calibrate_capture
from schemas.base.errors import DamagedError
from schemas.parameters.calibration import CaptureCalibrationParameters


@pytest.mark.parametrize("damage", ["changed", "missing"])
def test_a_capture_that_is_not_what_was_filmed_is_filmed_anew(tmp_path: Path, damage: str) -> None:
    files = {"cam1.avi": b"a film", "capture.yaml": b"format: footscan.capture/1\n"}
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    listing = json.dumps({name: sha256(content) for name, content in files.items()}).encode()
    if damage == "missing":
        (tmp_path / "cam1.avi").unlink()
    else:
        (tmp_path / "cam1.avi").write_bytes(b"a fils")
    with pytest.raises(DamagedError, match=r"cam1\.avi: is not what was filmed; run again"):
        calibrate_capture.run({"capture": listing}, CaptureCalibrationParameters(), {"capture": tmp_path})
    assert not (tmp_path / "capture.yaml").exists()
