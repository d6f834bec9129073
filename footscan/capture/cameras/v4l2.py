"""Queries and settings of a camera by Video4Linux2, with the ioctls of the kernel's `linux/videodev2.h`.

As much of it as the scanner needs: the library that wraps all of it is under the GPL, and this project is not.
"""

import errno
import fcntl
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from schemas.base.errors import Fault

READ, WRITE = 2, 1
CAPTURE = 1
"""`V4L2_BUF_TYPE_VIDEO_CAPTURE`, and the bit of the same name among a device's capabilities."""
DEVICE_CAPS = 0x8000_0000
DISABLED, READ_ONLY, INACTIVE = 0x01, 0x04, 0x10
DISCRETE = 1
MOST_ENTRIES = 256
"""Longest list of a driver that is read: an endless one must not block the program."""

_CAPABILITY = struct.Struct("=16s32s32s6I")
_FORMAT = struct.Struct("=3I32s5I")
_FRAME_SIZE = struct.Struct("=3I6I2I")
_FRAME_INTERVAL = struct.Struct("=5I6I2I")
_CONTROL_RANGE = struct.Struct("=2I32s4iI2I")
_CONTROL = struct.Struct("=Ii")


def _request(direction: int, number: int, layout: struct.Struct) -> int:
    """Compute a request number as the macro `_IOC` of the kernel's headers does."""
    return direction << 30 | layout.size << 16 | ord("V") << 8 | number


QUERY_CAPABILITY = _request(READ, 0, _CAPABILITY)
LIST_FORMATS = _request(READ | WRITE, 2, _FORMAT)
LIST_FRAME_SIZES = _request(READ | WRITE, 74, _FRAME_SIZE)
LIST_FRAME_INTERVALS = _request(READ | WRITE, 75, _FRAME_INTERVAL)
GET_CONTROL = _request(READ | WRITE, 27, _CONTROL)
SET_CONTROL = _request(READ | WRITE, 28, _CONTROL)
QUERY_CONTROL = _request(READ | WRITE, 36, _CONTROL_RANGE)


@dataclass(frozen=True)
class VideoFormat:
    """An image size of a camera in one encoding, and its frame rates."""

    encoding: str
    """Four characters: `MJPG`, `YUYV`."""
    rows: int
    columns: int
    frames_per_second: tuple[float, ...]
    """Empty if the camera accepts any."""


@dataclass(frozen=True)
class ControlRange:
    """Range of a control."""

    name: str
    least: int
    most: int
    step: int
    is_inactive: bool
    """True if another control overrides it, as automatic exposure overrides the exposure."""


@contextmanager
def open_device(node: Path) -> Iterator[int]:
    """Open a device for queries and settings; Fault if it cannot be opened, or is gone."""
    try:
        descriptor = os.open(node, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            yield descriptor
        finally:
            os.close(descriptor)
    except OSError as error:
        raise Fault(f"{node}: {error.strerror or error}") from None


def camera_name(descriptor: int) -> str | None:
    """Return the name that the camera reports; None for a device that takes no pictures."""
    reply = _asked(descriptor, QUERY_CAPABILITY, _CAPABILITY, b"", b"", b"", *[0] * 6)
    if reply is None:
        return None
    _, name, _, _, of_all, of_this, *_ = reply
    abilities = of_this if of_all & DEVICE_CAPS else of_all
    return _decoded(name) if abilities & CAPTURE else None


def video_formats(descriptor: int) -> list[VideoFormat]:
    """List all encodings, sizes and rates."""
    formats = []
    for _, _, _, _, pixel_format, *_ in _listed(descriptor, LIST_FORMATS, _FORMAT, CAPTURE, 0, b"", *[0] * 5):
        encoding = struct.pack("=I", pixel_format).decode("ascii", "replace").strip()
        sizes = _listed(descriptor, LIST_FRAME_SIZES, _FRAME_SIZE, pixel_format, *[0] * 9)
        for _, _, kind, columns, *bounds in sizes:
            rows = bounds[0] if kind == DISCRETE else bounds[3]
            width = columns if kind == DISCRETE else bounds[0]  # stepwise: least, most, step of columns, then of rows
            rates = tuple(
                interval[6] / interval[5]
                for interval in _listed(
                    descriptor, LIST_FRAME_INTERVALS, _FRAME_INTERVAL, pixel_format, width, rows, *[0] * 9
                )
                if interval[4] == DISCRETE and interval[5]
            )
            formats.append(VideoFormat(encoding, rows, width, rates))
    return formats


def control_range(descriptor: int, control: int) -> ControlRange | None:
    """Return the range of a control; None if the camera lacks it."""
    reply = _asked(descriptor, QUERY_CONTROL, _CONTROL_RANGE, control, 0, b"", *[0] * 7)
    if reply is None:
        return None
    _, _, name, least, most, step, _, flags, *_ = reply
    if flags & (DISABLED | READ_ONLY):
        return None
    return ControlRange(_decoded(name), least, most, max(step, 1), bool(flags & INACTIVE))


def get_control(descriptor: int, control: int) -> int | None:
    """Return the value of a control; None if the camera does not report it."""
    reply = _asked(descriptor, GET_CONTROL, _CONTROL, control, 0)
    return None if reply is None else int(reply[1])


def set_control(descriptor: int, control: int, value: int) -> bool:
    """Set a control; returns True if the camera accepted it. `get_control` returns the value that it chose."""
    return _asked(descriptor, SET_CONTROL, _CONTROL, control, value) is not None


REFUSALS = {errno.EINVAL, errno.ENOTTY, errno.ERANGE, errno.EACCES, errno.EBUSY, errno.EIO, errno.EPIPE}
"""Error numbers of a request that a camera does not know or accept; any other error is one of the device."""


def _asked(descriptor: int, request: int, layout: struct.Struct, *fields: int | bytes) -> tuple[Any, ...] | None:
    buffer = bytearray(layout.pack(*fields))
    try:
        fcntl.ioctl(descriptor, request, buffer, True)
    except OSError as error:
        if error.errno in REFUSALS:
            return None
        raise
    return layout.unpack(buffer)


def _listed(descriptor: int, request: int, layout: struct.Struct, *fields: int | bytes) -> Iterator[tuple[Any, ...]]:
    for index in range(MOST_ENTRIES):
        reply = _asked(descriptor, request, layout, index, *fields)
        if reply is None:
            return
        yield reply


def _decoded(text: bytes) -> str:
    return text.split(b"\0")[0].decode("utf-8", "replace")
