"""The documents of a scanner, a jig and a reference model, as they are handed to us."""

from pathlib import Path

import pytest

from schemas.base.errors import RefusedInput
from schemas.base.yaml_files import read_yaml
from schemas.reference import Capture, ReferenceObject
from schemas.scan import Scan, Travel
from schemas.workflow import Workflow

SCAN = """\
format: footscan.scan/1
patient: P0001               # pseudonym: letters, digits, '-' and '_', 1 to 64 of them
scan: 2026-11-20-R           # the same alphabet
side: right                  # left | right | unknown
travel: {start_mm: 0.0, step_mm: 2.0}       # X of frame k of a camera = start_mm + k * step_mm
calibration: ../calibration.json            # optional here; a workflow may give it instead
truth: truth.stl             # optional: reference model in the scanner's own frame, for verification only
cameras:
  - {id: 1, file: cam1.avi}
  - {id: 2, file: cam2.avi, travel: {start_mm: 0.5, step_mm: 2.0}}      # a camera's own travel wins
  - {id: 3, file: cam3.avi, positions: cam3.csv}                        # uneven steps: columns frame,x_mm
  - {id: 4, file: cam4/}                                                # a folder of PNG or JPEG frames, in name order
"""

REFERENCE = """\
format: footscan.reference/1
profile_mm: [[-20, 0], [20, 0], [20, 30], [50, 30], [50, 70], [20, 70], [20, 100], [-20, 100], [-20, 70], [-50, 70], \
[-50, 30], [-20, 30]]   # (Y, Z), closed
placements_mm: [[0, 0]]      # (dY, dZ) of each placement; one captured frame each
"""

CAPTURE = """\
format: footscan.capture/1
reference: reference.yaml
x_mm: 0.0                    # where the laser plane stands
cameras:
  - {id: 1, file: cam1.avi}  # or a folder of PNG or JPEG frames
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "document.yaml"
    path.write_text(text)
    return path


def test_scan_is_accepted(tmp_path: Path) -> None:
    scan = read_yaml(write(tmp_path, SCAN), Scan)
    assert (scan.patient, scan.scan, scan.side) == ("P0001", "2026-11-20-R", "right")
    assert scan.travel == Travel(start_mm=0.0, step_mm=2.0)
    assert (scan.calibration, scan.truth) == ("../calibration.json", "truth.stl")
    assert [camera.id for camera in scan.cameras] == [1, 2, 3, 4]
    assert scan.cameras[1].travel == Travel(start_mm=0.5, step_mm=2.0)
    assert (scan.cameras[2].positions, scan.cameras[3].file) == ("cam3.csv", "cam4/")


def test_a_camera_of_a_scan_may_have_a_background(tmp_path: Path) -> None:
    assert [camera.background for camera in read_yaml(write(tmp_path, SCAN), Scan).cameras] == [None] * 4
    text = SCAN.replace("file: cam1.avi", "file: cam1.avi, background: off/cam1.png")
    assert read_yaml(write(tmp_path, text), Scan).cameras[0].background == "off/cam1.png"
    with pytest.raises(RefusedInput) as caught:
        read_yaml(write(tmp_path, text.replace("off/cam1.png", "''")), Scan)
    assert str(caught.value).endswith(
        "cameras.0.background: expected a path relative to this file, found '' (line 9, column 41)"
    )
    with pytest.raises(RefusedInput, match=r"cameras.0.background: unknown field"):
        read_yaml(write(tmp_path, CAPTURE.replace("cam1.avi", "cam1.avi, background: off.avi")), Capture)


def test_each_camera_may_bring_its_own_travel(tmp_path: Path) -> None:
    text = "\n".join(line for line in SCAN.splitlines() if not line.startswith("travel:"))
    with pytest.raises(RefusedInput, match=r"camera 1 has no travel, expected travel or positions$"):
        read_yaml(write(tmp_path, text), Scan)
    text = text.replace("cam1.avi", "cam1.avi, positions: a.csv").replace("cam4/", "cam4/, positions: b.csv")
    assert read_yaml(write(tmp_path, text), Scan).travel is None


def test_reference_is_accepted(tmp_path: Path) -> None:
    reference = read_yaml(write(tmp_path, REFERENCE), ReferenceObject)
    assert len(reference.profile_mm) == 12
    assert reference.profile_mm[3] == [50.0, 30.0]
    assert reference.placements_mm == [[0.0, 0.0]]


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("[50, 30]", "[50]", "profile_mm.3"),
        ("[50, 30]", "[50, 30, 1]", "profile_mm.3"),
        ("[50, 30]", "[50, x]", "profile_mm.3.1"),
        ("[50, 30]", "[50, .inf]", "profile_mm.3.1"),
        ("[[0, 0]]", "[]", "placements_mm"),
    ],
)
def test_broken_reference_is_refused(tmp_path: Path, old: str, new: str, field: str) -> None:
    with pytest.raises(RefusedInput) as caught:
        read_yaml(write(tmp_path, REFERENCE.replace(old, new, 1)), ReferenceObject)
    assert caught.value.field == field


def test_capture_is_accepted(tmp_path: Path) -> None:
    capture = read_yaml(write(tmp_path, CAPTURE), Capture)
    assert (capture.reference, capture.x_mm, capture.cameras[0].file) == ("reference.yaml", 0.0, "cam1.avi")
    twice = CAPTURE + "  - {id: 1, file: cam2.avi}\n"
    with pytest.raises(RefusedInput, match=r"camera 1 is listed twice, expected each id once$"):
        read_yaml(write(tmp_path, twice), Capture)


def test_workflow_refuses_misspelt_parameters_by_name(tmp_path: Path) -> None:
    text = "format: footscan.workflow/1\narchive: a\nresults: r\nparameters: {outliers: {island_shares: 0.1}}\n"
    with pytest.raises(RefusedInput) as caught:
        read_yaml(write(tmp_path, text), Workflow)
    assert caught.value.field == "parameters.outliers.island_shares"
    assert caught.value.problem == "unknown field, did you mean 'island_share'? (line 4, column 25)"
    right = read_yaml(write(tmp_path, text.replace("island_shares", "island_share")), Workflow)
    assert right.parameters.outliers.island_share == 0.1
