"""Periodic checks in a thread of its own while a block runs."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def looking_on(look: Callable[[], None], every_seconds: float, name: str) -> Iterator[None]:
    """Call `look` every `every_seconds` until the block ends; the end waits for a running call."""
    ended = threading.Event()

    def watch() -> None:
        while not ended.wait(every_seconds):
            look()

    thread = threading.Thread(target=watch, name=name, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
