"""The source of a camera's packets: a V4L2 device by its stable name, or a URL, opened by PyAV."""

import errno
import os
import select
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from footscan import clock
from schemas.base.errors import Fault, RefusedInput
from schemas.base.image_size import FRAME_SIZE, ImageSize

if TYPE_CHECKING:
    from av import FFmpegError
    from av.container import InputContainer

OLDEST_STAMP_S = 5.0
"""A stamp of the driver that is older than this, or in the future, belongs to another clock. Chosen by hand."""
POLL_S = 0.25
IMMEDIATE_EXIT = 1414092869
"""`AVERROR_EXIT`, which ffmpeg returns when our time limit is over."""


@dataclass(frozen=True)
class CameraSource:
    """A camera and the settings with which it is opened."""

    address: str
    """`/dev/v4l/by-path/...`, `/dev/v4l/by-id/...`, `/dev/video0`, or a URL (http, rtsp, ...) of Motion-JPEG."""
    size: ImageSize = FRAME_SIZE
    """Requested from a V4L2 device, expected of any other."""
    frames_per_second: float | None = None
    """Requested from a V4L2 device, expected of any other; None: any."""
    open_s: float = 10.0
    read_s: float = 3.0
    """Longest silence before the connection counts as lost."""
    reconnect_s: float = 0.5
    """Pause between two attempts to connect."""

    @property
    def is_device(self) -> bool:
        """True for a V4L2 device, False for a URL."""
        return self.address.startswith("/")

    @property
    def name(self) -> str:
        """The address, without a password."""
        scheme, separator, rest = self.address.partition("://")
        return f"{scheme}://{rest.rpartition('@')[2]}" if separator else self.address

    @property
    def period_s(self) -> float | None:
        """Period of the frames; None if the camera chooses the rate."""
        return 1 / self.frames_per_second if self.frames_per_second else None


@dataclass(frozen=True, slots=True)
class StampedPacket:
    """The bytes of a frame and their time, `time.monotonic()` s."""

    jpeg: bytes
    seconds: float
    stamps: Literal["driver", "arrival"]
    is_first: bool


@contextmanager
def opened(source: CameraSource) -> "Iterator[InputContainer]":
    """Open a camera.

    Raises
    ------
    Fault
        It is not there, does not answer, or went away while it was open; in words, with what to do.
    RefusedInput
        It is there, but sends no Motion-JPEG.
    """
    import av  # 0.1 s that other commands need not wait for

    timeouts = (source.open_s, source.read_s)
    form = "v4l2" if source.is_device else None
    try:
        with av.open(source.address, "r", format=form, options=_options(source), timeout=timeouts) as container:
            codecs = [stream.codec_context.name for stream in container.streams.video if stream.codec_context]
            if codecs[:1] != ["mjpeg"]:
                found = codecs[0] if codecs else "no video"
                raise RefusedInput(source.name, f"expected Motion-JPEG, found {found}", field="codec")
            yield container
    except av.FFmpegError as error:
        raise Fault(f"{source.name}: {_told(error, source)}") from None


def packets(container: "InputContainer", source: CameraSource, stopping: threading.Event) -> Iterator[StampedPacket]:
    """Yield packets until the camera ends or `stopping` is set; to be read within `opened`, which reports errors."""
    device = _descriptor_of(source.address) if source.is_device else None
    demuxed = container.demux(video=0)
    stamps: Literal["driver", "arrival"] | None = None
    while not stopping.is_set():
        if device is not None and not _device_has_frame(device, source, stopping):
            return
        packet = next(demuxed, None)
        arrived = clock.seconds()
        if packet is None or (packet.size == 0 and packet.pts is None):  # the second one is there to flush a decoder
            return
        stamp = None if device is None else driver_stamp(packet.pts, packet.time_base, arrived)
        is_first = stamps is None
        if stamps is None:
            stamps = "arrival" if stamp is None else "driver"
        yield StampedPacket(bytes(packet), arrived if stamps == "arrival" or stamp is None else stamp, stamps, is_first)


def driver_stamp(pts: int | None, time_base: Fraction | None, arrived: float) -> float | None:
    """The kernel's stamp of a frame that `arrived` just now, in seconds of the monotonic clock, which is Python's.

    None where there is no stamp, or one of another clock, as some drivers give.
    """
    if pts is None or time_base is None:
        return None
    stamp = float(pts * time_base)
    return stamp if arrived - OLDEST_STAMP_S <= stamp <= arrived else None


def _options(source: CameraSource) -> dict[str, str]:
    if source.is_device:
        rate = {"framerate": f"{source.frames_per_second:.6g}"} if source.frames_per_second else {}
        size = f"{source.size.columns}x{source.size.rows}"
        return {"input_format": "mjpeg", "video_size": size, "timestamps": "default", **rate}
    if source.address.startswith("rtsp"):
        return {"rtsp_transport": "tcp"}  # lost datagrams would tear frames
    return {}


def _told(error: "FFmpegError", source: CameraSource) -> str:
    if error.errno == IMMEDIATE_EXIT:
        return f"no answer within {source.open_s:g} s, or no frame for {source.read_s:g} s"
    advice = DEVICE_ADVICE if source.is_device else URL_ADVICE
    return advice.get(error.errno or 0, error.strerror or str(error))


DEVICE_ADVICE = {
    errno.ENOENT: "no such camera: is it plugged in, and into the same port?",
    errno.ENODEV: "the camera has gone: its cable was pulled, or its hub lost power",
    errno.ENXIO: "the camera has gone: its cable was pulled, or its hub lost power",
    errno.EIO: "the camera does not answer: plug it in again, with a shorter cable if it happens often",
    errno.EBUSY: "another program uses this camera: close it",
    errno.EACCES: "no permission: the user must be in the group that owns the device (video)",
    errno.ENOSPC: "its USB bus has no bandwidth left beside the other cameras: film in passes, or use another bus",
    errno.EINVAL: "it does not film Motion-JPEG of this size and rate",
}
URL_ADVICE = {
    errno.ECONNREFUSED: "nobody answers at this address",
    errno.ETIMEDOUT: "nobody answers at this address",
    errno.EIO: "nobody answers at this address, or the connection broke",
}


def _descriptor_of(address: str) -> int | None:
    """The descriptor by which ffmpeg holds the device open.

    Its read waits in the kernel, where neither a time limit nor `close` reaches it; to wait here instead, for as long
    as we will, takes the descriptor, which ffmpeg keeps to itself.
    """
    try:
        device = Path(address).stat().st_rdev
    except OSError:
        raise Fault(f"{address}: {DEVICE_ADVICE[errno.ENODEV]}") from None
    for entry in Path("/proc/self/fd").iterdir():
        descriptor = int(entry.name)
        try:
            if os.fstat(descriptor).st_rdev == device:
                return descriptor
        except OSError:
            continue  # closed meanwhile by another thread
    return None


def _device_has_frame(descriptor: int, source: CameraSource, stopping: threading.Event) -> bool:
    """Wait for a frame; returns False if the stream is to end. Fault after the longest silence."""
    poll = select.poll()
    poll.register(descriptor, select.POLLIN)
    limit = time.monotonic() + source.read_s
    while not stopping.is_set():
        if poll.poll(POLL_S * 1000):
            return True
        if time.monotonic() > limit:
            raise Fault(f"{source.name}: no frame for {source.read_s:g} s")
    return False
