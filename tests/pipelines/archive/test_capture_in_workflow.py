"""A workflow that names a capture: its calibration is planned, run, cached and refused with the scans that use it."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from pipelines.archive.running import ScanEnd
from pipelines.capture_job import calibrate_capture
from pipelines.recordings.captures import read_capture
from schemas.base.errors import RefusedInput
from schemas.parameters.calibration import CaptureCalibrationParameters

TAKES_THE_CALIBRATION = {"map-1", "map-5", "clean", "heads", "orient", "texture", "quality", "quality.json", "report"}


def use(archive: Any, calibration: str) -> None:
    workflow = yaml.safe_load(archive.workflow.read_text())
    workflow.pop("calibration", None)
    workflow["calibrations"] = [yaml.safe_load(calibration)]
    archive.workflow.write_text(yaml.safe_dump(workflow))


def results(archive: Any) -> tuple[ScanEnd, set[str]]:
    [end], ran = archive.run()
    return end, ran


@pytest.mark.slow
def test_a_capture_in_the_workflow_gives_what_its_calibration_gives(archive: Any, capture: Path) -> None:
    use(archive, f"{{capture: {capture}}}")
    count, reasons = archive.plan()
    assert count == len(reasons)
    assert reasons["stripe-5"] == "never run"
    assert reasons["map-5"].startswith("waits for ")
    captured, ran = results(archive)
    assert {"stripe-1", "recognise-2", "fit-5", "place", "calibrate", "camera-map-5", "map-5", "fuse", "surface"} <= ran
    assert archive.plan()[1] == {}
    assert results(archive)[1] == set()

    made = calibrate_capture(read_capture(capture), CaptureCalibrationParameters(), 2)
    (archive.root / "made.json").write_text(made.calibration.model_dump_json(indent=2) + "\n")
    use(archive, "{file: made.json}")
    from_file, ran = results(archive)
    assert {"map-1", "map-5", "clean", "orient"} <= ran <= TAKES_THE_CALIBRATION  # with equal results: nothing follows
    assert (from_file.kind, from_file.problem) == (captured.kind, captured.problem)


def test_a_refused_capture_refuses_the_scan_in_the_same_line(archive: Any, capture: Path) -> None:
    document = yaml.safe_load((capture / "capture.yaml").read_text())
    document["cameras"][2]["file"] = "cam7.avi"
    (capture / "capture.yaml").write_text(yaml.safe_dump(document))
    use(archive, f"{{capture: {capture}}}")
    with pytest.raises(RefusedInput) as refused:
        calibrate_capture(read_capture(capture), CaptureCalibrationParameters(), 2)
    for _ in range(2):
        end, _ran = results(archive)
        assert (end.kind, end.problem) == ("refused", str(refused.value))


def test_a_capture_without_a_camera_of_the_scan_refuses_it(archive: Any, capture: Path) -> None:
    document = yaml.safe_load((capture / "capture.yaml").read_text())
    document["cameras"].pop()
    (capture / "capture.yaml").write_text(yaml.safe_dump(document))
    use(archive, f"{{capture: {capture}}}")
    problem = f"{capture / 'capture.yaml'}: cameras: has no camera 5, expected one of 1, 2"
    assert (results(archive)[0].kind, results(archive)[0].problem) == ("refused", problem)
