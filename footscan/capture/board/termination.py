"""Termination by a signal: heads and lasers stop first, whatever else the program does.

A signal is handled twice. A separate thread receives it at once and stops the boards (`emergency_stop`), even while the
main thread waits or runs library code. The main thread receives it when it can, as an exception that passes through
every `with` block.
"""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Protocol

ENDING = tuple(number for number in signal.Signals if number.name in {"SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT"})
SUSPENDING = next((number for number in signal.Signals if number.name == "SIGTSTP"), None)
PATIENCE_SECONDS = 10.0
"""A signal that is repeated after this time ends the program at once; heads and lasers are then stopped. Chosen by
hand."""
Handler = Callable[[int, FrameType | None], None]
_NO_MORE = b"\0"
TURN_SECONDS = 0.0005
"""Switch interval of the interpreter. With Python's default of 5 ms and twenty busy threads, each step on the way to
the board would take 0.1 s."""


class Stop(Protocol):
    """Stops a board; may be called in any thread, and repeatedly."""

    def __call__(self, *, for_good: bool) -> bool:
        """Return True if the board confirmed the stop. `for_good`: the board accepts no order afterwards."""
        ...


class EndedBySignal(SystemExit):
    """A signal ended the program; its exit status is 128 plus the number of the signal, as in a shell."""

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        self.number = number
        self.confirmed = True
        """True if every board confirmed that it stopped."""

    def __str__(self) -> str:
        name = signal.Signals(self.number).name
        if self.confirmed:
            return f"ended by {name}: heads and lasers are stopped; what is complete is kept"
        return f"ended by {name}: the board did not confirm that it stopped; switch off its power to be sure"


@contextmanager
def signals_end_the_program() -> Iterator[None]:
    """Stop all boards within 0.3 s of Ctrl-C, SIGTERM, SIGHUP or SIGQUIT, and end the program with `EndedBySignal`.

    Ctrl-Z stops the boards too, before the program is suspended. SIGHUP stays ignored if it is, as under nohup.
    Only the main thread receives signals; in other threads this does nothing. If the program is killed (SIGKILL) or
    the power fails, the board itself ends the light.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    watch = _Watch()
    handlers: dict[signal.Signals, Handler] = dict.fromkeys(ending_signals(), watch.end)
    if SUSPENDING is not None:
        handlers[SUSPENDING] = watch.suspend
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    turn = sys.getswitchinterval()
    sys.setswitchinterval(TURN_SECONDS)
    try:
        yield
    except BaseException:
        if watch.ended_by is None:
            raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.setswitchinterval(turn)
        watch.close()
    if watch.ended_by is not None:  # even if its exception was caught on the way
        ended = EndedBySignal(watch.ended_by)
        ended.confirmed = watch.confirmed
        raise ended


def ending_signals() -> list[signal.Signals]:
    """Return the signals that end the program: without SIGHUP if it is ignored, as under nohup."""
    return [number for number in ENDING if number.name != "SIGHUP" or signal.getsignal(number) is not signal.SIG_IGN]


class Boards:
    """The boards that are connected now."""

    def __init__(self) -> None:
        self._stops: list[Stop] = []
        self._lock = threading.Lock()
        self.must_end = False  # not an Event: a handler within a handler would wait for its lock forever

    def enlist(self, stop: Stop) -> None:
        """Call `stop` when the program is to end; at once if it already is."""
        with self._lock:
            self._stops.append(stop)
        if self.must_end:
            stop(for_good=True)

    def dismiss(self, stop: Stop) -> None:
        """Forget `stop`; if the program is to end, it is called first."""
        if self.must_end:
            stop(for_good=True)
        with self._lock:
            if stop in self._stops:
                self._stops.remove(stop)

    def stop(self, *, for_good: bool) -> bool:
        """Stop all boards; returns True if all confirmed it."""
        with self._lock:
            stops = list(self._stops)
        confirmed = [stop(for_good=for_good) for stop in stops]
        return all(confirmed)


BOARDS = Boards()


class _Watch:
    """Receives signals in a separate thread, by the bytes that Python's handler in C writes."""

    def __init__(self) -> None:
        self.ended_by: int | None = None
        self.confirmed = True
        self._first = 0.0
        BOARDS.must_end = False
        self._wakeup, self._signal = os.pipe()
        os.set_blocking(self._signal, False)
        self._before = signal.set_wakeup_fd(self._signal, warn_on_full_buffer=False)
        self._thread = threading.Thread(target=self._watch, name="termination", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread, after the stops under way."""
        signal.set_wakeup_fd(self._before)
        os.write(self._signal, _NO_MORE)
        self._thread.join()
        os.close(self._wakeup)
        os.close(self._signal)

    def end(self, number: int, _frame: FrameType | None) -> None:
        """Raise `EndedBySignal` in the main thread, once: a repeated signal does not disturb its clean-up."""
        BOARDS.must_end = True
        if self.ended_by is None:
            self.ended_by, self._first = number, time.monotonic()
            raise EndedBySignal(number)
        if time.monotonic() - self._first > PATIENCE_SECONDS:
            os._exit(128 + number)

    def suspend(self, _number: int, _frame: FrameType | None) -> None:
        """Do nothing: the thread suspends the program when the boards have stopped."""

    def _watch(self) -> None:
        while (byte := os.read(self._wakeup, 1)) != _NO_MORE:
            if byte[0] in ENDING:
                BOARDS.must_end = True
                self.confirmed = BOARDS.stop(for_good=True)
            elif byte[0] == SUSPENDING:
                BOARDS.stop(for_good=False)
                os.kill(os.getpid(), signal.SIGSTOP)
