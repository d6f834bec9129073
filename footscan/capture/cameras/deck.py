"""All cameras of a scanner: opens those of a pass and hands on their frames."""

import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import Self

from footscan import clock
from footscan.capture.cameras.frame_clock import FrameTimes
from footscan.capture.cameras.source import CameraSource
from footscan.capture.cameras.stream import CameraStream, CapturedFrame, StreamHealth
from schemas.base.errors import Fault

Sink = Callable[[CapturedFrame], None]
"""Takes a frame at once, on the thread of its camera; raises `queue.Full` if it has no room."""

FIRST_FRAMES = 5
"""Frames of a newly opened camera that are awaited before it is used. Chosen by hand."""
LONGEST_WAIT_SECONDS = 20.0
STREAMING_LOOKS_SECONDS = 0.02


class CameraDeck:
    """Opens and closes cameras; a context manager that closes all at its end."""

    def __init__(self, sources: Mapping[int, CameraSource]) -> None:
        self.sources = dict(sources)
        self._streams: dict[int, CameraStream] = {}
        self._latest: dict[int, CapturedFrame] = {}
        self._sink: Sink | None = None
        self._changing = threading.Lock()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def open_cameras(self) -> tuple[int, ...]:
        """Numbers of the cameras that film now."""
        return tuple(sorted(self._streams))

    def open_only(self, cameras: Collection[int], timeout_s: float = LONGEST_WAIT_SECONDS) -> dict[int, str]:
        """Close all other cameras, open these, and wait for their first frames.

        Returns
        -------
        problems : what is wrong with each camera that gives no frames; those that do are open.
        """
        with self._changing:
            self._close([camera for camera in self._streams if camera not in cameras])
            for camera in sorted(set(cameras) - set(self._streams)):
                self._streams[camera] = CameraStream(camera, self.sources[camera], self._deliver)
        return self._wait_for(cameras, FIRST_FRAMES, timeout_s)

    @contextmanager
    def open_after(self, cameras: Collection[int]) -> Iterator[None]:
        """Open these cameras alone when the block ends, however it does, without waiting for their frames."""
        try:
            yield
        finally:
            with suppress(Fault):  # their health says what is wrong
                self.open_only(cameras, 0.0)

    def health(self) -> dict[int, StreamHealth]:
        """Health of the streams of the open cameras."""
        return {camera: stream.health for camera, stream in self._opened()}

    def latest(self, camera: int) -> CapturedFrame | None:
        """Return the latest frame of a camera, for a live picture."""
        return self._latest.get(camera)

    def send_to(self, sink: Sink | None) -> None:
        """Send frames to `take` from now on; None: nowhere."""
        self._sink = sink

    def times(self, camera: int) -> tuple[int, FrameTimes]:
        """Return the arrival index of the oldest frame that is kept, and the times of all from there; see
        `CameraStream.times`."""
        return self._streams[camera].times()

    def wait_beyond(self, seconds: float, timeout_s: float) -> None:
        """Wait until every open camera has sent a frame after `seconds`, or for `timeout_s`."""
        end = clock.seconds() + timeout_s
        while clock.seconds() < end:
            last = [self._latest.get(camera) for camera in self.open_cameras]
            if all(frame is not None and frame.seconds > seconds for frame in last):
                return
            time.sleep(STREAMING_LOOKS_SECONDS)

    def close(self) -> None:
        """Close all cameras."""
        with self._changing:
            self._sink = None
            self._close(list(self._streams))

    def _opened(self) -> list[tuple[int, CameraStream]]:
        with self._changing:
            return sorted(self._streams.items())

    def _deliver(self, frame: CapturedFrame) -> None:
        self._latest[frame.camera] = frame
        if (sink := self._sink) is not None:
            sink(frame)

    def _wait_for(self, cameras: Collection[int], frames: int, timeout_s: float) -> dict[int, str]:
        end = clock.seconds() + timeout_s
        problems = {}
        for camera, stream in self._opened():
            if camera not in cameras:
                continue
            try:
                stream.wait_for_frames(frames, max(end - clock.seconds(), 0.1 if timeout_s else 0.0))
            except Fault as fault:
                problems[camera] = str(fault)
        return problems

    def _close(self, cameras: list[int]) -> None:
        """Close cameras in parallel: one that does not answer takes seconds to close."""
        streams = [self._streams.pop(camera) for camera in cameras]
        for camera in cameras:
            self._latest.pop(camera, None)
        if not streams:
            return
        with ThreadPoolExecutor(len(streams)) as pool:
            ends = [pool.submit(stream.close) for stream in streams]
        for end in ends:
            end.result()
