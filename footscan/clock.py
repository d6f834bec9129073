"""The clock of a scanner: the system's monotonic clock, or that of a virtual world.

A virtual world takes its time. What it has to make by a moment, such as the picture that a camera sends then, holds its
clock at that moment until it is made. A busy computer makes the world slower, and nothing in it late.

A process has one clock, which all its threads read by `seconds`. The process of a world keeps a `WorldClock` in a file,
and that of its scanner reads the file.
"""

import mmap
import struct
import threading
import time
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

LONGEST_HOLD_SECONDS = 60.0
"""A clock that is held longer goes on: what holds it has died. Chosen by hand."""
SHORTEST_WAIT_SECONDS = 0.002
"""Between two looks at a clock that may be held. Chosen by hand."""
RECEIPT_SECONDS = 2.0
"""Longest wait for the receipt of a picture, s of the system's clock. Chosen by hand."""
CAMERAS = 32
NUMBER, STATE = struct.Struct("<q"), struct.Struct("<ddd")
"""The file: a number that is odd while the state behind it is written, then the state, then of each camera the number
of pictures that were received, which the process that follows writes."""
RECEIPTS = NUMBER.size + STATE.size
SIZE = RECEIPTS + CAMERAS * NUMBER.size


class _State(NamedTuple):
    """From a moment of the system's clock on, the world's clock goes as fast, up to the next hold."""

    system: float
    world: float
    held_at: float

    def seconds(self, system: float) -> float:
        """Time of the world at a time of the system."""
        passed = system - self.system
        free = max(self.held_at - self.world, 0.0)
        return self.world + min(passed, free) + max(passed - free - LONGEST_HOLD_SECONDS, 0.0)


class WorldClock:
    """A monotonic clock that can be held; other processes follow it by its file."""

    def __init__(self, file: Path) -> None:
        file.write_bytes(bytes(SIZE))
        self._view = _mapped(file)
        self._lock = threading.Lock()
        self._holds: dict[Hashable, float] = {}
        self._number = 0
        now = time.monotonic()
        self._set(_State(now, now, float("inf")))

    def seconds(self) -> float:
        """The present time."""
        return self._state.seconds(time.monotonic())

    def hold(self, what: Hashable, until: float) -> None:
        """Keep the clock from passing `until` as long as `what` is not released; its earlier hold ends."""
        with self._lock:
            self._holds[what] = until
            self._rebase()

    def release(self, what: Hashable) -> None:
        """End a hold, if there is one."""
        with self._lock:
            if self._holds.pop(what, None) is not None:
                self._rebase()

    def receipts(self, camera: int) -> int:
        """Number of pictures of a camera that the process that follows has received."""
        return int(NUMBER.unpack(self._view[_receipts_of(camera)])[0])

    def _rebase(self) -> None:
        system = time.monotonic()
        self._set(_State(system, self._state.seconds(system), min(self._holds.values(), default=float("inf"))))

    def _set(self, state: _State) -> None:
        self._state = state
        self._number += 2
        self._view[: NUMBER.size] = NUMBER.pack(self._number - 1)
        self._view[NUMBER.size : RECEIPTS] = STATE.pack(*state)
        self._view[: NUMBER.size] = NUMBER.pack(self._number)


class _FollowedClock:
    """The clock of another process."""

    def __init__(self, file: Path) -> None:
        self._view = _mapped(file)
        self._received: dict[int, int] = {}

    def seconds(self) -> float:
        while True:
            [before] = NUMBER.unpack(self._view[: NUMBER.size])
            state = _State(*STATE.unpack(self._view[NUMBER.size : RECEIPTS]))
            [after] = NUMBER.unpack(self._view[: NUMBER.size])
            if before == after and before % 2 == 0:
                return state.seconds(time.monotonic())

    def received(self, camera: int) -> None:
        self._received[camera] = number = self._received.get(camera, 0) + 1
        self._view[_receipts_of(camera)] = NUMBER.pack(number)


def _mapped(file: Path) -> mmap.mmap:
    with file.open("r+b") as opened:
        return mmap.mmap(opened.fileno(), SIZE)


def _receipts_of(camera: int) -> slice:
    start = RECEIPTS + camera % CAMERAS * NUMBER.size
    return slice(start, start + NUMBER.size)


class _World:
    """The world of this process, or that of another one, which it follows."""

    own: WorldClock | None = None
    other: _FollowedClock | None = None


def seconds() -> float:
    """The present time of this process's clock, s."""
    world = _World.own or _World.other
    return time.monotonic() if world is None else world.seconds()


def is_of_a_world() -> bool:
    """Whether the clock is that of a virtual world."""
    return _World.own is not None or _World.other is not None


@contextmanager
def keeping(world: WorldClock) -> Iterator[None]:
    """Make `world` the clock of this process."""
    before, _World.own = _World.own, world
    try:
        yield
    finally:
        _World.own = before


@contextmanager
def following(file: Path) -> Iterator[None]:
    """Make the `WorldClock` of another process, which keeps it in `file`, the clock of this one."""
    before, _World.other = _World.other, _FollowedClock(file)
    try:
        yield
    finally:
        _World.other = before


def hold(what: Hashable, until: float) -> None:
    """`WorldClock.hold` of this process's world; the system's clock cannot be held."""
    if _World.own is not None:
        _World.own.hold(what, until)


def release(what: Hashable) -> None:
    """`WorldClock.release` of this process's world."""
    if _World.own is not None:
        _World.own.release(what)


def received(camera: int) -> None:
    """Tell the world, if this process follows one, that a picture has come and has its time."""
    if _World.other is not None:
        _World.other.received(camera)


def receipts(camera: int) -> int:
    """`WorldClock.receipts` of this process's world; 0 without one."""
    return 0 if _World.own is None else _World.own.receipts(camera)


def wait_for_receipt(camera: int, before: int) -> None:
    """Wait until more than `before` pictures were received; not for one who has never told of any."""
    end = time.monotonic() + RECEIPT_SECONDS
    while before and receipts(camera) == before and time.monotonic() < end:
        time.sleep(SHORTEST_WAIT_SECONDS / 4)


def wait_until(event: threading.Event, moment: float) -> bool:
    """Wait until the clock shows `moment` or `event` is set; returns whether it is set."""
    while (left := moment - seconds()) > 0.0:
        if event.wait(max(left, SHORTEST_WAIT_SECONDS) if is_of_a_world() else left):
            return True
    return event.is_set()


def wait_for(condition: threading.Condition, predicate: Callable[[], bool], timeout_s: float) -> bool:
    """`condition.wait_for` by this clock."""
    end = seconds() + timeout_s
    while not (done := condition.wait_for(predicate, max(end - seconds(), 0.0))) and seconds() < end:
        pass
    return done
