"""Calibration captures as they come from a scanner."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
import simplejpeg
from PIL import Image

from pipelines.recordings.captures import read_capture
from schemas.base.errors import RefusedInput
from schemas.mounting import Mounting, mounting_of

CAPTURE = """\
format: footscan.capture/1
reference: reference.yaml
x_mm: 0.0                    # where the laser plane stands
cameras:
  - {id: 1, file: cam1.avi}  # or a folder of PNG or JPEG frames
  - {id: 2, file: cam2/, stands: [left, above]}
"""
REFERENCE = """\
format: footscan.reference/1
profile_mm: [[-20, 0], [20, 0], [20, 30], [50, 30], [50, 70], [20, 70], [20, 100], [-20, 100], [-20, 70], [-50, 70], \
[-50, 30], [-20, 30]]   # (Y, Z), closed
placements_mm: [[0, 0], [30, 0], [-30, 0]]
"""
BLACK = np.zeros((480, 640, 3), np.uint8)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three placements, filmed by one camera and photographed by the other."""
    folder = tmp_path / "archive/capture"
    (folder / "cam2").mkdir(parents=True)
    (folder / "capture.yaml").write_text(CAPTURE)
    (folder / "reference.yaml").write_text(REFERENCE)
    write_film(folder / "cam1.avi", 3)
    for number in range(3):
        Image.fromarray(BLACK).save(folder / f"cam2/{number:04}.png")
    return folder


def write_film(path: Path, frames: int) -> None:
    picture = bytes(simplejpeg.encode_jpeg(BLACK, 85, "RGB", "420"))
    with av.open(path, "w", format="avi") as container:
        stream = container.add_mux_stream("mjpeg", rate=18, width=640, height=480)
        stream.time_base = Fraction(1, 18)
        for number in range(frames):
            packet = av.Packet(picture)
            packet.stream, packet.time_base, packet.pts, packet.dts = stream, stream.time_base, number, number
            packet.duration, packet.is_keyframe = 1, True
            container.mux(packet)


def replace(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def refusal(folder: Path) -> str:
    """What is said of a broken capture, without the folder before it."""
    with pytest.raises(RefusedInput) as caught:
        read_capture(folder)
    line = str(caught.value)
    assert line.startswith(f"{folder}/")
    return line.removeprefix(f"{folder}/")


def test_a_capture_is_read_with_its_reference(folder: Path) -> None:
    capture = read_capture(folder)
    assert (capture.folder, capture.file) == (folder, folder / "capture.yaml")
    assert capture.reference_file == folder / "reference.yaml"
    assert capture.reference.placements_mm == [[0, 0], [30, 0], [-30, 0]]
    one, two = capture.document.cameras
    assert (capture.film(one), capture.film(two)) == (folder / "cam1.avi", folder / "cam2")
    assert (mounting_of(one), mounting_of(two)) == (Mounting(1, 1, 1), Mounting(0, 1, 1))


def test_the_number_of_frames_is_that_of_placements(folder: Path) -> None:
    write_film(folder / "cam1.avi", 4)
    assert refusal(folder) == "cam1.avi: 4 frames, expected 3, one for each placement of reference.yaml"
    write_film(folder / "cam1.avi", 3)
    for number in (0, 2):
        (folder / f"cam2/{number:04}.png").unlink()
    assert refusal(folder) == "cam2: 1 frame, expected 3, one for each placement of reference.yaml"


def test_a_missing_film_or_document_is_refused(folder: Path) -> None:
    (folder / "cam1.avi").rename(folder / "other.avi")
    assert refusal(folder) == "cam1.avi: no such film"
    (folder / "reference.yaml").rename(folder / "other.yaml")
    assert refusal(folder) == "reference.yaml: no such file"
    (folder / "capture.yaml").unlink()
    assert refusal(folder) == "capture.yaml: no such file"


def test_what_is_no_film_is_refused(folder: Path) -> None:
    (folder / "cam1.avi").write_text("a letter")
    assert refusal(folder) == "cam1.avi: header: expected an AVI film"


def test_frames_that_are_too_small_are_refused(folder: Path) -> None:
    for number in range(3):
        Image.fromarray(BLACK[:240, :319]).save(folder / f"cam2/{number:04}.png")
    assert refusal(folder) == "cam2: frame size: expected frames of at least 320 x 240 pixels, found 319 x 240"


def test_a_broken_reference_is_refused_by_name(folder: Path) -> None:
    replace(folder / "reference.yaml", "[30, 0]", "[0, 0]")
    told = "placement 1 repeats placement 0, expected each placement once"
    assert refusal(folder) == f"reference.yaml: placements_mm: {told} (line 3, column 16)"
    replace(folder / "capture.yaml", "reference: reference.yaml", "reference: capture.yaml")
    assert refusal(folder).startswith("capture.yaml: ")
    replace(folder / "capture.yaml", "reference: capture.yaml", "reference: .")
    with pytest.raises(RefusedInput, match=r"archive/capture: expected a file$"):
        read_capture(folder)


@pytest.mark.parametrize("path", ["../cam2.avi", "link/cam2.avi"])
def test_paths_may_not_leave_the_folder(folder: Path, path: str) -> None:
    write_film(folder.parent / "cam2.avi", 3)
    (folder / "link").symlink_to(folder.parent)
    replace(folder / "capture.yaml", "cam2/", path)
    assert refusal(folder).startswith(f"capture.yaml: file of camera 2: '{path}' leaves the archive")


def test_the_reference_may_not_leave_the_folder(folder: Path) -> None:
    (folder / "reference.yaml").rename(folder.parent / "reference.yaml")
    replace(folder / "capture.yaml", "reference.yaml", "../reference.yaml")
    assert refusal(folder).startswith("capture.yaml: reference: '../reference.yaml' leaves the archive")


def test_what_is_no_folder_is_refused(folder: Path) -> None:
    with pytest.raises(RefusedInput, match=r"capture\.yaml: is a file, expected the folder that holds capture\.yaml$"):
        read_capture(folder / "capture.yaml")
    with pytest.raises(RefusedInput, match=r"nowhere: no such folder, expected a calibration capture$"):
        read_capture(folder / "nowhere")
