"""Devices of a rig: what is opened, and what is connected."""

import math
from collections.abc import Collection
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from footscan import clock
from footscan.capture.board.head import Head
from footscan.capture.cameras.devices import CameraDevice, list_cameras
from footscan.capture.cameras.source import CameraSource
from footscan.capture.cameras.usb_bus import Pass, UsbCamera, plan_passes
from footscan.capture.cameras.usb_topology import usb_place
from footscan.capture.film_frames import CameraTiming
from footscan.capture.frame_positions import Timed
from footscan.clock import LONGEST_HOLD_SECONDS
from schemas.base.errors import RefusedInput
from schemas.rig import Rig, RigCamera


@dataclass(frozen=True)
class SerialPort:
    """A serial port of this computer."""

    device: str
    stable_name: str
    words: str
    """Description that the adapter reports."""


def heads_of(rig: Rig) -> list[Head]:
    """Offset, direction and axis of each head."""
    return [
        Head(head.offset_mm, head.direction, rig.axis_of(number) - 1) for number, head in enumerate(rig.heads, start=1)
    ]


def sources_of(rig: Rig) -> dict[int, CameraSource]:
    """Source of the frames of each camera, by camera.

    Those of a virtual world may be silent for as long as its clock may be held.
    """
    sources = {
        camera.id: CameraSource(camera.device, frames_per_second=rig.frames_per_second) for camera in rig.cameras
    }
    if not clock.is_of_a_world():
        return sources
    longest = LONGEST_HOLD_SECONDS
    return {camera: replace(source, open_s=longest, read_s=longest) for camera, source in sources.items()}


def timing_of(camera: RigCamera, exposure_ms: float | None = None) -> CameraTiming:
    """Timing of a camera at an exposure, in ms; RefusedInput if its latency is unknown.

    If the exposure differs from that at which the latency was measured, the middle of the exposure moves. The camera
    does not report the direction, so the shift is added to the uncertainty.
    """
    latency = camera.latency
    if latency is None:
        raise RefusedInput(
            f"camera {camera.id}",
            "is missing in the rig, expected it from 'footscan calibrate latency'",
            field="latency",
        )
    shift_s = 0.0
    if exposure_ms is not None and latency.exposure_ms is not None:
        shift_s = abs(exposure_ms - latency.exposure_ms) / 2000.0
    timed = Timed(latency.seconds, math.hypot(latency.sd_s, shift_s))
    return CameraTiming(timed, latency.exposure_share, latency.frame_sd_s)


def passes_of(rig: Rig, cameras: Collection[int]) -> list[Pass]:
    """Plan the passes in which the cameras can film; each has its reason."""
    return plan_passes([_place(camera) for camera in rig.cameras if camera.id in cameras])


def serial_ports() -> list[SerialPort]:
    """All serial ports, with the names that stay the same after replugging."""
    from serial.tools import list_ports

    links = {link.resolve(): link for link in sorted(Path("/dev/serial/by-id").glob("*"))}
    return [
        SerialPort(port.device, str(links.get(Path(port.device).resolve(), port.device)), str(port.description))
        for port in sorted(list_ports.comports(), key=lambda port: str(port.device))
    ]


def devices_json(rig: Rig | None) -> dict[str, Any]:
    """The connected devices, and those that the rig expects, as a JSON object."""
    cameras = list_cameras()
    connected = {
        "serial_ports": [asdict(port) for port in serial_ports()],
        "cameras": [_camera_json(camera) for camera in cameras],
    }
    if rig is None:
        return connected
    names = {str(name) for camera in cameras for name in (camera.node, camera.by_path, camera.by_id) if name}
    expected = [
        {
            "camera": camera.id,
            "device": camera.device,
            "head": camera.on_head,
            "there": None if not camera.device.startswith("/") else camera.device in names,
            "latency_ms": None if camera.latency is None else round(1e3 * camera.latency.seconds, 3),
        }
        for camera in rig.cameras
    ]
    passes = [asdict(planned) for planned in passes_of(rig, [camera.id for camera in rig.cameras])]
    return {**connected, "rig": {"port": rig.port, "cameras": expected, "passes": passes}}


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
