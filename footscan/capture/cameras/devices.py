"""The cameras of this computer: their names, their ports and their formats."""

from dataclasses import dataclass
from pathlib import Path

from footscan.capture.cameras.usb_bus import UsbCamera
from footscan.capture.cameras.usb_topology import SYSFS, usb_place
from footscan.capture.cameras.v4l2 import VideoFormat, camera_name, open_device, video_formats
from schemas.base.errors import Fault

DEV = Path("/dev")


@dataclass(frozen=True)
class CameraDevice:
    """A camera of this computer."""

    name: str
    """Name that the camera reports; cameras of one model share it."""
    node: Path
    """Device node, such as `/dev/video0`: assigned anew at every start of the computer."""
    by_path: Path | None
    """Name by the USB port: stable for cameras of one model, as long as each keeps its port."""
    by_id: Path | None
    """Name by maker, model and serial number; of cameras without one, only the last that was plugged in has it."""
    usb: UsbCamera
    """Its place on USB; `camera` is its position in the list, from 1."""
    formats: tuple[VideoFormat, ...]
    problem: str | None
    """Reason why the device cannot be queried; None if it can."""

    @property
    def stable_name(self) -> Path:
        """Name for a rig: by port, or else by identity, or else the node."""
        return self.by_path or self.by_id or self.node


def list_cameras(dev: Path = DEV, sysfs: Path = SYSFS) -> list[CameraDevice]:
    """List all devices that take pictures, in the order of their ports, without the metadata nodes of cameras."""
    nodes = sorted(dev.glob("video*"), key=lambda node: (len(node.name), node.name))
    found = [camera for node in nodes if (camera := _camera(node, dev, sysfs)) is not None]
    found.sort(key=lambda camera: str(camera.stable_name))
    return [_numbered(camera, place, sysfs) for place, camera in enumerate(found, start=1)]


def _camera(node: Path, dev: Path, sysfs: Path) -> CameraDevice | None:
    by_path, by_id = (_link_to(node, dev / "v4l" / kind) for kind in ("by-path", "by-id"))
    try:
        with open_device(node) as device:
            name = camera_name(device)
            if name is None:
                return None
            formats, problem = tuple(video_formats(device)), None
    except Fault as fault:
        name, formats, problem = node.name, (), str(fault)
    return CameraDevice(name, node, by_path, by_id, usb_place(0, node, sysfs), formats, problem)


def _numbered(camera: CameraDevice, place: int, sysfs: Path) -> CameraDevice:
    usb = usb_place(place, camera.node, sysfs)
    return CameraDevice(camera.name, camera.node, camera.by_path, camera.by_id, usb, camera.formats, camera.problem)


def _link_to(node: Path, folder: Path) -> Path | None:
    try:
        links = sorted(folder.iterdir())
    except OSError:
        return None
    return next((link for link in links if link.resolve() == node.resolve()), None)
