"""Whether the page that moves heads by hand is still there: it says so several times a second."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from schemas.base.errors import Fault, FootscanError

GONE_SECONDS = 0.5
"""A page that is not heard of for so long is gone: closed, cut off, or it hangs. Its script speaks every 0.15 s."""
LOOKS_SECONDS = 0.05


class Presence:
    """When a page was heard of last; of any thread."""

    def __init__(self) -> None:
        self._page: str | None = None
        self._heard = 0.0

    def here(self, page: str) -> None:
        """The page is there; one that nobody waits for is not listened to."""
        if page == self._page:
            self._heard = time.monotonic()

    @contextmanager
    def needed(self, page: str, stop: Callable[[], None]) -> Iterator[None]:
        """Calls `stop` when the page is gone, until the block has ended.

        Raises
        ------
        Fault
            The page was gone, whatever the block made of that.
        """
        self._page, self._heard = page, time.monotonic()
        ended, gone = threading.Event(), threading.Event()

        def watch() -> None:
            while not ended.wait(LOOKS_SECONDS):
                if time.monotonic() - self._heard > GONE_SECONDS:
                    gone.set()
                    with suppress(FootscanError):  # the state tells it
                        stop()

        thread = threading.Thread(target=watch, name="presence of the page", daemon=True)
        thread.start()
        try:
            yield
        except FootscanError:
            if not gone.is_set():
                raise
        finally:
            self._page = None
            ended.set()
            thread.join()
        if gone.is_set():
            raise Fault(f"the page that moved the heads was gone for {GONE_SECONDS:g} s: they were stopped")
