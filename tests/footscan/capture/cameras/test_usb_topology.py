"""Cameras in a made-up sysfs, laid out as Linux lays it out."""

from pathlib import Path

import pytest

from footscan.capture.cameras.usb_bus import UsbCamera
from footscan.capture.cameras.usb_topology import StreamingSetting, streaming_settings, usb_place

DEVICE = bytes([18, 1, 0, 2, 239, 2, 1, 64, 0x6D, 4, 0x25, 8, 16, 0, 0, 0, 2, 1])
"""A device descriptor, of 18 bytes; the parser has no use for it."""


def interface(number: int, alternate: int, subclass: int = 2, kind: int = 14) -> bytes:
    return bytes([9, 4, number, alternate, 1, kind, subclass, 0, 0])


def endpoint(packet: int, packets: int = 1, transfer: int = 1, address: int = 0x81) -> bytes:
    size = packet | (packets - 1) << 11
    return bytes([7, 5, address, transfer | 4, size & 0xFF, size >> 8, 1])


WEBCAM = (
    DEVICE
    + bytes([9, 2, 0, 0, 2, 1, 0, 0x80, 250])  # configuration
    + interface(0, 0, subclass=1)  # control, with an interrupt endpoint
    + endpoint(16, transfer=3, address=0x87)
    + interface(1, 0)
    + bytes([14, 0x24, *[0] * 12])  # formats, which only the class knows
    + interface(1, 1)
    + endpoint(128)
    + interface(1, 2)
    + endpoint(800)
    + interface(1, 3)
    + endpoint(1024, packets=3)
    + interface(2, 1, kind=1)  # a microphone is isochronous too
    + endpoint(100)
)


def test_settings_of_a_webcam() -> None:
    assert list(streaming_settings(WEBCAM)) == [
        StreamingSetting(1, 1, 1, 128),
        StreamingSetting(1, 2, 1, 800),
        StreamingSetting(1, 3, 1, 3072),
    ]


def test_settings_of_a_super_speed_camera() -> None:
    """There the companion tells the bytes: 24576 an interval."""
    companion = bytes([6, 0x30, 15, 1, 0x00, 0x60])
    data = interface(1, 1) + endpoint(1024) + companion
    assert list(streaming_settings(data)) == [StreamingSetting(1, 1, 1, 24576)]


@pytest.mark.parametrize("length", range(len(WEBCAM)))
def test_torn_descriptors_give_what_is_there(length: int) -> None:
    assert set(streaming_settings(WEBCAM[:length])) <= set(streaming_settings(WEBCAM))


def test_a_descriptor_without_length_ends_it() -> None:
    assert list(streaming_settings(interface(1, 1) + bytes(20) + endpoint(128))) == []


def test_place_of_a_camera_behind_a_hub(tmp_path: Path) -> None:
    device = plug(tmp_path, "video0", "usb1/1-2/1-2.4", WEBCAM)
    expected = UsbCamera(3, "usb1", "1-2.4", 480.0, (128, 800, 3072))
    assert usb_place(3, tmp_path / "dev/video0", tmp_path / "sys") == expected
    (device / "1-2.4:1.1/bAlternateSetting").write_text(" 2\n")
    assert usb_place(3, tmp_path / "dev/video0", tmp_path / "sys").reserved == 800


def test_a_stable_name_leads_to_the_same_place(tmp_path: Path) -> None:
    plug(tmp_path, "video2", "usb1/1-1", WEBCAM)
    link = tmp_path / "by-path"
    link.symlink_to(tmp_path / "dev/video2")
    assert usb_place(1, link, tmp_path / "sys").port == "1-1"


def test_a_bulk_camera(tmp_path: Path) -> None:
    plug(tmp_path, "video0", "usb1/1-1", interface(1, 0) + endpoint(512, transfer=2))
    found = usb_place(1, tmp_path / "dev/video0", tmp_path / "sys")
    assert (found.is_bulk, found.payloads, found.payload) == (True, (), 0)


def test_a_camera_that_is_on_no_usb_bus(tmp_path: Path) -> None:
    assert usb_place(1, tmp_path / "dev/video9", tmp_path / "sys") == UsbCamera(1)


def plug(root: Path, node: str, port: str, descriptors: bytes) -> Path:
    """A camera in sysfs; its folder."""
    device = root / "sys/devices/pci0000:00/0000:00:14.0" / port
    for number in (0, 1):
        folder = device / f"{device.name}:1.{number}"
        folder.mkdir(parents=True)
        (folder / "bInterfaceNumber").write_text(f"0{number}\n")
        (folder / "bAlternateSetting").write_text(" 0\n")
    (device / "busnum").write_text("1\n")
    (device / "speed").write_text("480\n")
    (device / "descriptors").write_bytes(descriptors)
    entry = root / "sys/class/video4linux" / node
    entry.mkdir(parents=True)
    (entry / "device").symlink_to(device / f"{device.name}:1.0")
    (root / "dev").mkdir(exist_ok=True)
    (root / "dev" / node).write_bytes(b"")
    return device
