"""The stream of one camera: its JPEG packets as they arrive, each with its time and its problem.

PyAV takes the packets out of a V4L2 device or of any URL that ffmpeg opens; none is decoded by ffmpeg. A thread of its
own reads them, so that nothing waits in the camera, and connects again after a loss. That makes later frames usable for
looking at; a scan under way has lost the frames in between, and `health` says so.
"""

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from queue import Full
from types import TracebackType
from typing import TYPE_CHECKING, Literal, Self

import numpy as np

from footscan import clock
from footscan.capture.cameras.frame_clock import Bools, Floats, FrameTimes, RunningNumber, number_frames
from footscan.capture.cameras.jpeg_check import torn_reason
from footscan.capture.cameras.source import CameraSource, opened, packets
from schemas.base.errors import Fault, RefusedInput

if TYPE_CHECKING:
    from av.container import InputContainer

HISTORY = 8192
"""Number of frames that `times` keeps: seven minutes. A bound of memory."""
CLOSE_SECONDS = 5.0

State = Literal["connecting", "streaming", "silent", "lost", "closed"]


@dataclass(frozen=True, slots=True)
class CapturedFrame:
    """A frame as it arrived."""

    camera: int
    arrival: int
    """Number of earlier frames of this stream, delivered or not: its index in `CameraStream.times`."""
    number: int
    """Number of earlier exposures of the camera. Provisional: `CameraStream.times` is exact afterwards."""
    seconds: float
    """`clock.seconds()`, s: the stamp of the driver if there is one, or else the arrival of its last byte."""
    jpeg: bytes
    problem: str | None
    """`torn: ...`, `repeated: ...` or `reconnected: ...`; None for a sound frame. Late and lost ones: `times`."""


@dataclass(frozen=True)
class StreamHealth:
    """The present health of a stream."""

    state: State
    """`silent`: connected, but without frames for too long; `lost`: not connected, with further attempts."""
    problem: str | None = None
    """The present problem, in one line."""
    stamps: Literal["driver", "arrival"] | None = None
    """Origin of the time stamps: the driver, when frames leave the camera (to a ms), or this program, on arrival."""
    connections: int = 0
    """Number of connections; more than one means that the camera was lost in between, and scans of that time are
    incomplete."""
    received: int = 0
    torn: int = 0
    repeated: int = 0
    overflowed: int = 0
    """Number of frames for which the receiver had no room: lost, with their places in `times` kept."""
    last_seconds: float | None = None
    """Arrival of the last frame, `clock.seconds()`, s."""


class CameraStream:
    """Frames of one camera from its start to `close`; a context manager.

    Parameters
    ----------
    camera : its number
    source : where and what it is
    deliver
        Takes each frame, on the stream's own thread; must not take long. Raises `queue.Full` where it has no room
        (as `put_nowait` of a bounded queue does), so that memory stays bounded: the frame is lost, and counted.

    Cameras must run before the heads do: ffmpeg looks at the first frame before it hands it on, which then seems late.
    """

    def __init__(self, camera: int, source: CameraSource, deliver: Callable[[CapturedFrame], None]) -> None:
        self.camera = camera
        self.source = source
        self._deliver = deliver
        self._health = StreamHealth("connecting")
        self._since = clock.seconds()
        self._lock = threading.Lock()
        self._came = threading.Condition(self._lock)
        self._stopping = threading.Event()
        self._log = _Log()
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name=f"camera {camera}", daemon=True)
        self._thread.start()

    @property
    def health(self) -> StreamHealth:
        """The present health, even if the driver of the camera does not return."""
        with self._lock:
            health, since = self._health, self._since
        quiet = clock.seconds() - max(since, health.last_seconds or since)
        if health.state == "streaming" and quiet > self.source.read_s:
            problem = f"camera {self.camera}: connected, but no frame for {quiet:.1f} s"
            return replace(health, state="silent", problem=problem)
        if health.state == "connecting" and quiet > self.source.open_s:
            problem = f"camera {self.camera}: does not answer since {quiet:.1f} s"
            return replace(health, problem=problem)
        return health

    def wait_for_frames(self, frames: int, timeout_s: float) -> None:
        """Returns when so many frames have come since the stream was made, and the camera is connected; Fault where
        that is not so in time."""

        def is_so() -> bool:
            return self._health.state == "streaming" and self._health.received >= frames

        with self._came:
            if clock.wait_for(self._came, is_so, timeout_s):
                return
            received = self._health.received
        problem = self.health.problem or "the camera sends too slowly"
        raise Fault(f"camera {self.camera}: {received} of {frames} frames within {timeout_s:g} s ({problem})")

    def times(self) -> tuple[int, FrameTimes]:
        """Return the arrival index of the oldest frame that is kept, and number and time of each frame from there.

        RefusedInput where no frame has come.
        """
        with self._lock:
            first, stamps, repeated = self._log.arrays()
        try:
            return first, number_frames(stamps, repeated, self.source.period_s)
        except RefusedInput as error:
            raise RefusedInput(f"camera {self.camera}", error.problem, field=error.field) from None

    def close(self) -> None:
        """End the stream. Fault if the receiver failed, or the driver does not release the thread."""
        self._stopping.set()
        self._thread.join(max(self.source.open_s, self.source.read_s) + CLOSE_SECONDS)
        if self._thread.is_alive():
            raise Fault(f"camera {self.camera}: {self.source.name} does not let go: unplug it")
        if self._failure is not None:
            raise Fault(str(self.health.problem)) from self._failure

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                self._film()
                self._stopping.wait(self.source.reconnect_s)
            self._tell("closed", None)
        except _ReceiverError as error:  # told here and in `close`: it would be lost with the thread
            self._failure = error.__cause__
            self._tell("closed", f"camera {self.camera}: the receiver failed: {error.__cause__!r}")

    def _film(self) -> None:
        """Film over one connection, until it is lost or the stream ends."""
        try:
            with opened(self.source) as container:
                self._take_all(container)
            problem = f"{self.source.name}: the camera has ended its stream"
        except (Fault, RefusedInput) as error:
            problem = str(error)
        if not self._stopping.is_set():
            self._tell("lost", f"camera {self.camera}: {problem}")

    def _take_all(self, container: "InputContainer") -> None:
        before = b""
        reconnected = self.health.connections > 0
        for packet in packets(container, self.source, self._stopping):
            clock.received(self.camera)
            problem = None
            if reconnected:
                problem = "reconnected: first after a lost connection"
                reconnected = False
            reason = torn_reason(packet.jpeg, self.source.size)
            is_repeated = packet.jpeg == before
            if is_repeated:
                problem = "repeated: the same bytes as the frame before"
            if reason:
                problem = f"torn: {reason}"
            before = packet.jpeg
            with self._came:
                arrival, number = self._log.add(packet.seconds, is_repeated)
                health = self._health
                self._health = replace(
                    health,
                    state="streaming",
                    problem=None,
                    stamps=packet.stamps,
                    connections=health.connections + packet.is_first,
                    received=health.received + 1,
                    torn=health.torn + (reason is not None),
                    repeated=health.repeated + is_repeated,
                    last_seconds=clock.seconds(),
                )
                self._came.notify_all()
            try:
                self._deliver(CapturedFrame(self.camera, arrival, number, packet.seconds, packet.jpeg, problem))
            except Full:
                with self._lock:
                    self._health = replace(self._health, overflowed=self._health.overflowed + 1)
            except Exception as error:  # whatever it is, a full disk or a mistake: not the camera's
                raise _ReceiverError from error

    def _tell(self, state: State, problem: str | None) -> None:
        with self._lock:
            self._health = replace(self._health, state=state, problem=problem)
            self._since = clock.seconds()


class _ReceiverError(Exception):
    """The receiver failed to take a frame; its error is the cause."""


class _Log:
    """Arrival times of the latest frames, and the repeated ones."""

    def __init__(self) -> None:
        self._frames: deque[tuple[float, bool]] = deque(maxlen=HISTORY)
        self._running = RunningNumber()
        self._arrivals = 0

    def add(self, stamp: float, is_repeated: bool) -> tuple[int, int]:
        """Return the index of a frame and its provisional number."""
        if self._frames:
            stamp = max(stamp, self._frames[-1][0])  # a clock that another connection has set back
        self._frames.append((stamp, is_repeated))
        self._arrivals += 1
        return self._arrivals - 1, self._running.next(stamp)

    def arrays(self) -> tuple[int, Floats, Bools]:
        stamps = np.array([stamp for stamp, _ in self._frames], np.float64)
        return self._arrivals - len(stamps), stamps, np.array([repeated for _, repeated in self._frames], bool)
