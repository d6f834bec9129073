"""The place of a V4L2 camera on USB and the bandwidth that it may reserve, from Linux's sysfs."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from footscan.capture.cameras.usb_bus import UsbCamera

SYSFS = Path("/sys")
INTERFACE, ENDPOINT, SUPER_SPEED_COMPANION = 4, 5, 0x30
VIDEO_STREAMING = (0x0E, 0x02)
ISOCHRONOUS, BULK = 1, 2


def usb_place(camera: int, node: Path, sysfs: Path = SYSFS) -> UsbCamera:
    """Return the place of the camera behind a device node.

    While the camera films, what it has reserved is known too: Linux shows the setting that is in use.

    Parameters
    ----------
    camera : its number
    node : `/dev/video0`, or a stable name that leads to it
    """
    interface = (sysfs / "class/video4linux" / node.resolve().name / "device").resolve()
    device = interface.parent
    bus = _text(device / "busnum")
    if bus is None:
        return UsbCamera(camera)
    speed = _text(device / "speed")
    settings = list(streaming_settings(_bytes(device / "descriptors")))
    isochronous = [setting for setting in settings if setting.transfer == ISOCHRONOUS]
    in_use = _settings_in_use(device)
    return UsbCamera(
        camera,
        bus=f"usb{bus}",
        port=device.name,
        speed_mbit=float(speed) if speed else None,
        payloads=tuple(sorted({setting.payload for setting in isochronous})),
        is_bulk=bool(settings) and not isochronous,
        reserved=next((s.payload for s in isochronous if (s.interface, s.alternate) in in_use), None),
    )


@dataclass(frozen=True)
class StreamingSetting:
    """An alternate setting of a camera's video interface."""

    interface: int
    alternate: int
    transfer: int
    payload: int
    """Bytes per microframe."""


def streaming_settings(descriptors: bytes) -> Iterator[StreamingSetting]:
    """Read the settings with which a camera sends pictures from its USB descriptors (USB 2.0, 9.6; USB 3.2, 9.6.7)."""
    interface = alternate = -1
    is_video = False
    pending: StreamingSetting | None = None
    for kind, body in _descriptors(descriptors):
        if kind == SUPER_SPEED_COMPANION and pending is not None and len(body) >= 6:
            payload = int.from_bytes(body[4:6], "little")
            pending = StreamingSetting(pending.interface, pending.alternate, pending.transfer, payload)
            continue
        if pending is not None:
            yield pending
            pending = None
        if kind == INTERFACE and len(body) >= 9:
            interface, alternate = body[2], body[3]
            is_video = (body[5], body[6]) == VIDEO_STREAMING
        elif kind == ENDPOINT and len(body) >= 7 and is_video and body[2] & 0x80 and body[3] & 3 in {ISOCHRONOUS, BULK}:
            size = int.from_bytes(body[4:6], "little")
            packets = 1 + (size >> 11 & 3)  # of up to 1024 bytes in one microframe
            pending = StreamingSetting(interface, alternate, body[3] & 3, (size & 0x7FF) * packets)
    if pending is not None:
        yield pending


def _descriptors(data: bytes) -> Iterator[tuple[int, bytes]]:
    position = 0
    while position + 2 <= len(data):
        length = data[position]
        if length < 2:
            return  # torn: what follows has no length
        yield data[position + 1], data[position : position + length]
        position += length


def _settings_in_use(device: Path) -> set[tuple[int, int]]:
    """(interface, alternate setting) of each of the device's interfaces."""
    in_use = set()
    for interface in device.glob(f"{device.name}:*"):
        number, alternate = _text(interface / "bInterfaceNumber"), _text(interface / "bAlternateSetting")
        if number and alternate:
            in_use.add((int(number, 16), int(alternate)))
    return in_use


def _text(file: Path) -> str | None:
    try:
        return file.read_text(encoding="ascii", errors="replace").strip() or None
    except OSError:
        return None


def _bytes(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError:
        return b""
