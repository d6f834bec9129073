"""A look at regular intervals, in a thread of its own, while something else goes on."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def looking_on(look: Callable[[], None], every_seconds: float, name: str) -> Iterator[None]:
    """Calls `look` every so many seconds until the block ends; its end waits for a look that is under way."""
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
