"""From what a rig says to what can be opened; and what of it is there."""

import math
from collections.abc import Collection
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from footscan.capture.board.heads import Head
from footscan.capture.cameras.devices import CameraDevice, list_cameras
from footscan.capture.cameras.source import CameraSource
from footscan.capture.cameras.usb_bus import Pass, UsbCamera, plan_passes
from footscan.capture.cameras.usb_topology import usb_place
from footscan.capture.film_frames import CameraTiming
from footscan.capture.frame_positions import Timed
from schemas.base.errors import RefusedInput
from schemas.rig import Rig, RigCamera


@dataclass(frozen=True)
class SerialPort:
    """A serial port of this computer."""

    device: str
    stable_name: str
    words: str
    """What the adapter says of itself."""


def heads_of(rig: Rig) -> tuple[Head, Head, Head]:
    """How the rails of the three heads lie."""
    one, two, three = (Head(head.offset_mm, head.direction) for head in rig.heads)
    return one, two, three


def sources_of(rig: Rig) -> dict[int, CameraSource]:
    """Where each camera's pictures come from."""
    return {camera.id: CameraSource(camera.device, frames_per_second=rig.frames_per_second) for camera in rig.cameras}


def timing_of(camera: RigCamera, exposure_ms: float | None = None) -> CameraTiming:
    """What is known of a camera's times at an exposure; RefusedInput where its latency is not.

    An exposure other than that of the latency moves the middle of the frame, to which side the camera does not say.
    """
    known = camera.latency
    if known is None:
        raise RefusedInput(
            f"camera {camera.id}", "has none in the rig, expected it from 'footscan calibrate latency'", field="latency"
        )
    moved_s = 0.0
    if exposure_ms is not None and known.exposure_ms is not None:
        moved_s = abs(exposure_ms - known.exposure_ms) / 2000.0
    return CameraTiming(Timed(known.seconds, math.hypot(known.sd_s, moved_s)), known.exposure_share, known.frame_sd_s)


def passes_of(rig: Rig, cameras: Collection[int]) -> list[Pass]:
    """In how many passes the cameras can film, and why."""
    wanted = [camera for camera in rig.cameras if camera.id in cameras]
    return plan_passes([_place(camera) for camera in wanted])


def serial_ports() -> list[SerialPort]:
    """All serial ports, by the names that stay."""
    from serial.tools import list_ports

    links = {link.resolve(): link for link in sorted(Path("/dev/serial/by-id").glob("*"))}
    return [
        SerialPort(port.device, str(links.get(Path(port.device).resolve(), port.device)), str(port.description))
        for port in sorted(list_ports.comports(), key=lambda port: str(port.device))
    ]


def devices_json(rig: Rig | None) -> dict[str, Any]:
    """What is there, and what of it the rig expects."""
    cameras = list_cameras()
    found = {
        "serial_ports": [asdict(port) for port in serial_ports()],
        "cameras": [_camera_json(camera) for camera in cameras],
    }
    if rig is None:
        return found
    there = {str(name) for camera in cameras for name in (camera.node, camera.by_path, camera.by_id) if name}
    expected = [
        {
            "camera": camera.id,
            "device": camera.device,
            "head": camera.on_head,
            "there": None if not camera.device.startswith("/") else camera.device in there,
            "latency_ms": None if camera.latency is None else round(1e3 * camera.latency.seconds, 3),
        }
        for camera in rig.cameras
    ]
    passes = [asdict(each) for each in passes_of(rig, [camera.id for camera in rig.cameras])]
    return {**found, "rig": {"port": rig.port, "cameras": expected, "passes": passes}}


def _place(camera: RigCamera) -> UsbCamera:
    if not camera.device.startswith("/"):
        return UsbCamera(camera.id)
    return usb_place(camera.id, Path(camera.device))


def _camera_json(camera: CameraDevice) -> dict[str, Any]:
    return {
        "name": camera.name,
        "device": str(camera.stable_name),
        "node": str(camera.node),
        "bus": camera.usb.bus,
        "port": camera.usb.port,
        "formats": [asdict(form) for form in camera.formats],
        "problem": camera.problem,
    }
