"""The way out of a program that is told to end: heads and lasers stop first, whatever else the program does.

A signal is heard twice. A thread of its own hears it at once and stops the boards (`last_stop`), also while the main
thread waits for something or is deep in a library. The main thread hears it when it can, by an exception that every
`with` block sees.
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

ENDING = tuple(one for one in signal.Signals if one.name in {"SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT"})
SUSPENDING = next((one for one in signal.Signals if one.name == "SIGTSTP"), None)
PATIENCE_SECONDS = 10.0
"""A program that is told to end again after so long ends at once: heads and lasers were stopped long ago."""
Handler = Callable[[int, FrameType | None], None]
_NO_MORE = b"\0"
TURN_SECONDS = 0.0005
"""How long a thread keeps the interpreter from the others; Python's own 5 ms, with twenty busy threads, is 0.1 s for
each step on the way to the board."""


class Stop(Protocol):
    """Stops a board; safe to be called in any thread, and again."""

    def __call__(self, *, for_good: bool) -> bool:
        """Whether the board has confirmed it. `for_good`: the board takes no order afterwards."""
        ...


class EndedBySignal(SystemExit):
    """The program was told to end; its exit status is 128 and the signal's number, as a shell has it."""

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        self.number = number
        self.confirmed = True
        """Whether every board has confirmed that it stopped."""

    def __str__(self) -> str:
        name = signal.Signals(self.number).name
        if self.confirmed:
            return f"ended by {name}: heads and lasers are stopped; what is complete is kept"
        return f"ended by {name}: the board did not confirm that it stopped; switch off its power to be sure"


@contextmanager
def signals_end_the_program() -> Iterator[None]:
    """Stops all boards within 0.3 s of Ctrl-C, SIGTERM, SIGHUP or SIGQUIT, and ends the program by `EndedBySignal`.

    Ctrl-Z stops the boards too, before the program is suspended. SIGHUP stays ignored where it is, as under nohup.
    Only the main thread hears signals; elsewhere this does nothing. A program that is killed (SIGKILL) or loses its
    power has no way out: the board then sees to the light.
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
    if watch.ended_by is not None:  # whatever became of its exception on the way
        ended = EndedBySignal(watch.ended_by)
        ended.confirmed = watch.confirmed
        raise ended


def ending_signals() -> list[signal.Signals]:
    """The signals that end the program: not SIGHUP where it is ignored, as under nohup."""
    return [one for one in ENDING if one.name != "SIGHUP" or signal.getsignal(one) is not signal.SIG_IGN]


class Boards:
    """The boards that are connected now."""

    def __init__(self) -> None:
        self._stops: list[Stop] = []
        self._lock = threading.Lock()
        self.told_to_end = False  # no Event, whose lock a handler within a handler would wait for for ever

    def enlist(self, stop: Stop) -> None:
        """`stop` is called when the program is told to end; at once where it was."""
        with self._lock:
            self._stops.append(stop)
        if self.told_to_end:
            stop(for_good=True)

    def dismiss(self, stop: Stop) -> None:
        """`stop` is called no more. Where the program was told to end, this makes sure that it was."""
        if self.told_to_end:
            stop(for_good=True)
        with self._lock:
            if stop in self._stops:
                self._stops.remove(stop)

    def stop(self, *, for_good: bool) -> bool:
        """Stops all; whether all have confirmed it."""
        with self._lock:
            stops = list(self._stops)
        confirmed = [stop(for_good=for_good) for stop in stops]
        return all(confirmed)


BOARDS = Boards()


class _Watch:
    """Hears of signals in a thread of its own, by the bytes that Python's own handler in C writes."""

    def __init__(self) -> None:
        self.ended_by: int | None = None
        self.confirmed = True
        self._first = 0.0
        BOARDS.told_to_end = False
        self._hears, self._tells = os.pipe()
        os.set_blocking(self._tells, False)
        self._before = signal.set_wakeup_fd(self._tells, warn_on_full_buffer=False)
        self._thread = threading.Thread(target=self._watch, name="way out", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ends the thread, once it has stopped what it stops."""
        signal.set_wakeup_fd(self._before)
        os.write(self._tells, _NO_MORE)
        self._thread.join()
        os.close(self._hears)
        os.close(self._tells)

    def end(self, number: int, _frame: FrameType | None) -> None:
        """Ends the main thread, once: what it puts away on its way is not disturbed by the same signal again."""
        BOARDS.told_to_end = True
        if self.ended_by is None:
            self.ended_by, self._first = number, time.monotonic()
            raise EndedBySignal(number)
        if time.monotonic() - self._first > PATIENCE_SECONDS:
            os._exit(128 + number)

    def suspend(self, _number: int, _frame: FrameType | None) -> None:
        """Nothing: the thread suspends the program when the boards have stopped."""

    def _watch(self) -> None:
        while (heard := os.read(self._hears, 1)) != _NO_MORE:
            if heard[0] in ENDING:
                BOARDS.told_to_end = True
                self.confirmed = BOARDS.stop(for_good=True)
            elif heard[0] == SUSPENDING:
                BOARDS.stop(for_good=False)
                os.kill(os.getpid(), signal.SIGSTOP)
