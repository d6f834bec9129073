"""rig.yaml: short, with defaults; what is wrong is refused in one line."""

from pathlib import Path

import pytest

from schemas.base.errors import RefusedInput
from schemas.base.yaml_files import read_yaml
from schemas.rig import Rig, RigHead

SHORT = """\
format: footscan.rig/1
scanner: S1
port: /dev/serial/by-id/usb-1a86_USB_Serial-if00-port0
cameras:
  - {id: 1, device: /dev/v4l/by-path/pci-0000:00:14.0-usb-0:1:1.0-video-index0}
  - {id: 5, device: "http://192.168.1.20:81/stream", latency: {seconds: 0.081, sd_s: 0.0012}}
  - {id: 6, device: "http://192.168.1.21:81/stream", head: 2}
"""


def rig(folder: Path, text: str) -> Rig:
    path = folder / "rig.yaml"
    path.write_text(text)
    return read_yaml(path, Rig)


def test_a_short_rig_has_the_thesis_travel(tmp_path: Path) -> None:
    read = rig(tmp_path, SHORT)
    assert read.travel.end_mm == 400.0
    assert read.travel.length_mm / read.travel.mm_per_s == pytest.approx(11.0)
    assert read.frames_per_second * 11.0 == pytest.approx(200.0)
    assert [camera.on_head for camera in read.cameras] == [1, 3, 2]
    assert read.cameras[0].latency is None
    assert read.heads == (RigHead(), RigHead(), RigHead())


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("id: 5", "id: 1", "cameras: id 1 is listed twice, expected each once"),
        ("20:81", "21:81", "cameras: device http://192.168.1.21:81/stream is listed twice, expected each once"),
        ("id: 5", "id: 65", "cameras.1.id: "),
        ("id: 5", "id: 9", "cameras.1: camera 9 names no head, expected one"),
        ("head: 2", "head: 5", "cameras.2.head: "),
        ("head: 2", "head: 4", "cameras.2.head: camera 6 is on head 4, expected one of 3"),
        ("port:", "heads: [{}, {}, {}, {}]\nport:", "heads.3: names no axis, expected 1 to 3"),
        (
            "port:",
            "heads: [{}, {}, {axis: 1, direction: 1}]\nport:",
            "heads.2.direction: expected -1, the direction of head 1",
        ),
        ("port:", "heads: [{}, {}, {lasers: []}]\nport:", "heads.2.lasers: "),
        ("port:", "heads: [{}, {}, {lasers: [{}, {}, {}]}]\nport:", "heads.2.lasers: "),
        ("head: 2", "lasers: [2]", "cameras.2.lasers: camera 6 sees laser 2, expected one of 1 of head 3"),
        ("head: 2", "lasers: []", "cameras.2.lasers: "),
        ("head: 2", "stands: [left, right]", "cameras.2.stands: expected at most one of left and right"),
        ("port:", "board: {travel_mm: [430, 430, 0]}\nport:", "board.travel_mm.2: "),
        ("port:", "board: {travel_mm: [430, 430]}\nport:", "board.travel_mm.2: "),
        ("port:", "light: {shortest_ms: 30}\nport:", "shortest_ms: expected at most longest_ms, 20, found 30"),
        ("port:", "travel: {mm_per_s: 0}\nport:", "travel.mm_per_s: "),
        ("port:", "serial:", "serial: unknown field"),
        ("port:", "heads: [{direction: 2}, {}, {}]\nport:", "heads.0.direction: expected -1 or 1, found 2"),
        ("port:", "light: {mains_hz: 55}\nport:", "light.mains_hz: expected 0 or 50 or 60, found 55"),
    ],
)
def test_a_wrong_rig_is_refused(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    with pytest.raises(RefusedInput) as caught:
        rig(tmp_path, SHORT.replace(old, new))
    assert complaint in str(caught.value)


def test_a_rig_of_twelve_cameras_on_four_heads(tmp_path: Path) -> None:
    cameras = "".join(f"  - {{id: {number}, device: c{number}, head: {1 + number % 4}}}\n" for number in range(1, 12))
    text = f"""\
format: footscan.rig/1
scanner: S12
port: /dev/ttyUSB0
heads:
  - {{}}
  - {{}}
  - {{lasers: [{{offset_mm: 0}}, {{offset_mm: 12}}]}}
  - {{axis: 3, offset_mm: -150}}
cameras:
{cameras}  - {{id: 64, device: c64, head: 3, stands: [below, front], lasers: [2]}}
"""
    read = rig(tmp_path, text)
    assert [read.axis_of(head) for head in (1, 2, 3, 4)] == [1, 2, 3, 3]
    assert read.lasers_of(read.cameras[1]) == {1: 0.0, 2: 12.0}
    assert read.lasers_of(read.cameras[-1]) == {2: 12.0}
    assert read.lasers_of(read.cameras[0]) == {1: 0.0}
    assert read.cameras[-1].stands == ["below", "front"]
    with pytest.raises(RefusedInput, match="cameras: "):
        rig(tmp_path, text + "  - {id: 63, device: c63, head: 1}\n")
