"""Cameras set by a made-up kernel, which knows requests and layouts by the numbers of `linux/videodev2.h`."""

import errno
import struct
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from footscan.capture.cameras.devices import list_cameras
from footscan.capture.cameras.source import CameraSource
from footscan.capture.cameras.v4l2 import VideoFormat
from footscan.capture.cameras.video_controls import (
    ControlValues,
    FixedControl,
    HttpControls,
    NoControls,
    V4l2Controls,
    controls_of,
)
from footscan.virtual.filming.streams import VirtualStreams
from schemas.base.errors import Fault, RefusedInput

QUERYCAP, ENUM_FMT, ENUM_SIZES, ENUM_INTERVALS = 0x80685600, 0xC0405602, 0xC02C564A, 0xC034564B
G_CTRL, S_CTRL, QUERYCTRL = 0xC008561B, 0xC008561C, 0xC0445624
EXPOSURE_AUTO, EXPOSURE, GAIN, WHITE, WHITE_AUTO = 0x9A0901, 0x9A0902, 0x980913, 0x98091A, 0x98090C
FOCUS, FOCUS_AUTO, MAINS = 0x9A090A, 0x9A090C, 0x980918
INACTIVE = 0x10


@dataclass
class Knob:
    least: int
    most: int
    step: int
    value: int
    flags: int = 0
    stuck: bool = False


@dataclass
class MadeUpCamera:
    name: str = "Webcam C270"
    capabilities: int = 0x84000001
    of_this_node: int = 0x04200001
    knobs: dict[int, Knob] = field(default_factory=dict)
    silent: set[int] = field(default_factory=set)

    def ioctl(self, request: int, data: bytearray) -> None:
        if request == QUERYCAP:
            data[16 : 16 + len(self.name)] = self.name.encode()
            struct.pack_into("=2I", data, 84, self.capabilities, self.of_this_node)
        elif request in {ENUM_FMT, ENUM_SIZES, ENUM_INTERVALS}:
            self._list(request, data)
        elif request in {G_CTRL, S_CTRL, QUERYCTRL}:
            self._control(request, data)
        else:
            raise OSError(errno.ENOTTY, "no such request")

    def _list(self, request: int, data: bytearray) -> None:
        (index,) = struct.unpack_from("=I", data)
        if request == ENUM_FMT and index < 2:
            data[44:48] = (b"MJPG", b"YUYV")[index]
        elif request == ENUM_SIZES and index < 2 and data[4:8] == b"MJPG":
            struct.pack_into("=3I", data, 8, 1, *((640, 480), (1280, 720))[index])
        elif request == ENUM_INTERVALS and index < 2 and struct.unpack_from("=2I", data, 8) == (640, 480):
            struct.pack_into("=3I", data, 16, 1, 1, (30, 15)[index])
        else:
            raise OSError(errno.EINVAL, "end of list")

    def _control(self, request: int, data: bytearray) -> None:
        number, value = struct.unpack_from("=Ii", data)
        knob = self.knobs.get(number)
        if knob is None:
            raise OSError(errno.EINVAL, "no such control")
        if request == QUERYCTRL:
            data[8:24] = b"Knob".ljust(16, b"\0")
            struct.pack_into("=5i", data, 40, knob.least, knob.most, knob.step, knob.value, 0)
            struct.pack_into("=I", data, 56, knob.flags)
        elif request == S_CTRL:
            if not knob.least <= value <= knob.most:
                raise OSError(errno.ERANGE, "out of range")
            knob.value = knob.value if knob.stuck else value
        elif number in self.silent:
            raise OSError(errno.EIO, "no answer")
        else:
            struct.pack_into("=i", data, 4, knob.value)


class Kernel:
    """Answers for the files under a folder of device nodes."""

    def __init__(self, dev: Path) -> None:
        self.dev = dev
        self.cameras: dict[str, MadeUpCamera] = {}

    def plug(self, node: str, camera: MadeUpCamera) -> Path:
        (self.dev / node).write_bytes(b"")
        self.cameras[node] = camera
        return self.dev / node

    def ioctl(self, descriptor: int, request: int, data: bytearray, _mutate: bool) -> int:
        node = Path(f"/proc/self/fd/{descriptor}").readlink().name
        if node not in self.cameras:
            raise OSError(errno.ENODEV, "No such device")
        self.cameras[node].ioctl(request, data)
        return 0


@pytest.fixture
def kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Kernel:
    made_up = Kernel(tmp_path / "dev")
    made_up.dev.mkdir()
    monkeypatch.setattr("fcntl.ioctl", made_up.ioctl)
    return made_up


def webcam() -> MadeUpCamera:
    return MadeUpCamera(
        knobs={
            EXPOSURE_AUTO: Knob(0, 3, 1, 3),
            EXPOSURE: Knob(1, 10000, 1, 156),
            GAIN: Knob(0, 255, 1, 64),
            WHITE_AUTO: Knob(0, 1, 1, 1),
            WHITE: Knob(2800, 6500, 100, 4000),
            MAINS: Knob(0, 2, 1, 2),
        }
    )


def test_everything_is_fixed_and_read_back(kernel: Kernel) -> None:
    camera = webcam()
    controls = V4l2Controls(kernel.plug("video0", camera))
    fixed = controls.fix(ControlValues(exposure_ms=8.0, gain=0.2, white_balance_k=4600, mains_hz=50))
    assert fixed == [
        FixedControl("exposure_ms", 8.0, 8.0, None),
        FixedControl("gain", 0.2, pytest.approx(0.2), None),
        FixedControl("white_balance_k", 4600.0, 4600.0, None),
        FixedControl("mains_hz", 50.0, 50.0, None),
    ]
    assert {number: knob.value for number, knob in camera.knobs.items()} == {
        EXPOSURE_AUTO: 1,  # manual
        EXPOSURE: 80,  # tenths of a ms
        GAIN: 51,
        WHITE_AUTO: 0,
        WHITE: 4600,
        MAINS: 1,
    }


def test_what_is_not_named_stays(kernel: Kernel) -> None:
    camera = webcam()
    assert V4l2Controls(kernel.plug("video0", camera)).fix(ControlValues()) == []
    assert camera == webcam()


def test_a_control_that_is_lacking_is_told(kernel: Kernel) -> None:
    [focus] = V4l2Controls(kernel.plug("video0", webcam())).fix(ControlValues(focus=0.5))
    assert focus == FixedControl("focus", 0.5, None, "this camera has no such control")


def test_a_value_between_two_steps_is_as_good_as_asked(kernel: Kernel) -> None:
    [white] = V4l2Controls(kernel.plug("video0", webcam())).fix(ControlValues(white_balance_k=4660))
    assert (white.found, white.problem) == (4700.0, None)


def test_a_value_beyond_the_range_is_told(kernel: Kernel) -> None:
    [white] = V4l2Controls(kernel.plug("video0", webcam())).fix(ControlValues(white_balance_k=9000))
    assert (white.found, white.problem) == (6500.0, "set to 6500 instead of 9000")


def test_an_automatic_that_stays_on_is_told(kernel: Kernel) -> None:
    camera = webcam()
    camera.knobs[EXPOSURE_AUTO].stuck = True
    camera.knobs[EXPOSURE].flags = INACTIVE
    [exposure] = V4l2Controls(kernel.plug("video0", camera)).fix(ControlValues(exposure_ms=8))
    assert exposure.problem == "Knob stays on; Knob is overruled by an automatic"


def test_a_camera_that_sets_something_else_is_told(kernel: Kernel) -> None:
    camera = webcam()
    camera.knobs[GAIN].stuck = True
    [gain] = V4l2Controls(kernel.plug("video0", camera)).fix(ControlValues(gain=1.0))
    assert gain.problem == "set to 0.25098 instead of 1"


def test_a_camera_that_does_not_say_is_told(kernel: Kernel) -> None:
    camera = webcam()
    camera.silent = {GAIN}
    [gain] = V4l2Controls(kernel.plug("video0", camera)).fix(ControlValues(gain=1.0))
    assert gain == FixedControl("gain", 1.0, None, "the camera does not say what it has set")


def test_a_camera_that_has_gone_is_a_fault(kernel: Kernel) -> None:
    node = kernel.plug("video0", webcam())
    kernel.cameras.clear()
    with pytest.raises(Fault, match="video0: No such device"):
        V4l2Controls(node).fix(ControlValues(gain=1.0))
    with pytest.raises(Fault, match="video7: No such file"):
        V4l2Controls(node.with_name("video7")).fix(ControlValues(gain=1.0))


@pytest.mark.parametrize(
    "values",
    [
        ControlValues(gain=1.1),
        ControlValues(focus=-0.1),
        ControlValues(exposure_ms=0),
        ControlValues(gain=float("nan")),
    ],
)
def test_values_that_cannot_be(values: ControlValues) -> None:
    with pytest.raises(RefusedInput, match="expected"):
        NoControls().fix(values)


def test_a_network_camera_without_a_page_cannot_be_set() -> None:
    controls = controls_of(CameraSource("http://127.0.0.1/stream"))
    [gain] = controls.fix(ControlValues(gain=0.5))
    assert gain.found is None
    assert gain.problem == "this camera cannot be set from here: set it on its own page"


def test_a_network_camera_with_a_page() -> None:
    with VirtualStreams([1], lambda *_: b"") as streams:
        page = streams.url(1).replace("/stream", "/control")
        controls = controls_of(CameraSource(streams.url(1)), page)
        fixed = controls.fix(ControlValues(exposure_ms=6.5, gain=0.25, mains_hz=50))
        assert fixed == [
            FixedControl("exposure_ms", 6.5, 6.5, None),
            FixedControl("gain", 0.25, 0.25, None),
            FixedControl("mains_hz", 50, None, "this camera has no such control"),
        ]
        assert streams.settings(1) == {"exposure": 6.5, "gain": 0.25}
        with pytest.raises(Fault, match="cannot be set"):
            HttpControls(page.replace("control", "nothing")).fix(ControlValues(gain=0.5))


def test_a_page_of_another_kind_is_refused() -> None:
    with pytest.raises(RefusedInput, match="http or https"):
        HttpControls("file:///etc/hostname")


def test_cameras_are_listed_by_port_with_what_they_film(kernel: Kernel, tmp_path: Path) -> None:
    first, second = kernel.plug("video0", webcam()), kernel.plug("video2", webcam())
    kernel.plug("video1", MadeUpCamera(of_this_node=0x04A00000))  # metadata of the first
    for kind, name, node in [("by-path", "b-1.4", first), ("by-path", "a-1.2", second), ("by-id", "C270", second)]:
        (kernel.dev / "v4l" / kind).mkdir(parents=True, exist_ok=True)
        (kernel.dev / "v4l" / kind / name).symlink_to(node)
    cameras = list_cameras(kernel.dev, tmp_path / "sys")
    assert [camera.node for camera in cameras] == [second, first]
    assert [camera.stable_name.name for camera in cameras] == ["a-1.2", "b-1.4"]
    assert [camera.by_id.name if camera.by_id else None for camera in cameras] == ["C270", None]
    assert [camera.usb.camera for camera in cameras] == [1, 2]
    assert cameras[0].name == "Webcam C270"
    assert cameras[0].formats == (VideoFormat("MJPG", 480, 640, (30.0, 15.0)), VideoFormat("MJPG", 720, 1280, ()))


def test_a_camera_that_cannot_be_asked_is_listed_with_its_problem(kernel: Kernel, tmp_path: Path) -> None:
    kernel.plug("video0", webcam())
    kernel.cameras.clear()
    [camera] = list_cameras(kernel.dev, tmp_path / "sys")
    assert camera.problem is not None
    assert camera.problem.endswith("video0: No such device")


def test_a_computer_without_cameras(tmp_path: Path) -> None:
    assert list_cameras(tmp_path / "dev", tmp_path / "sys") == []
