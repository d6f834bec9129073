"""A way out for a program that is told to end: what `with` blocks promise holds then too."""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextmanager
def signals_end_the_program() -> Iterator[None]:
    """Makes the signals that end a program end it as Ctrl-C does: by an exception, so that lasers go off on the way.

    Python ends at once otherwise, with nothing put away. Only the main thread hears signals; elsewhere this does
    nothing. A program that is killed (SIGKILL) or loses its power has no way out: the board then sees to the light.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, _end) for number in ENDING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _end(number: int, _frame: FrameType | None) -> None:
    sys.exit(128 + number)
