"""Presence of the page that moves heads by hand: it reports several times a second that it is there."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from schemas.base.errors import Fault, FootscanError

GONE_SECONDS = 0.5
"""A page that was silent for this long is gone: closed, cut off or stuck. Its script reports every 0.15 s."""
LOOKS_SECONDS = 0.05
"""Interval at which the silence is checked."""


class Presence:
    """Time of the last report of a page; usable from any thread."""

    def __init__(self) -> None:
        self._page: str | None = None
        self._heard = 0.0

    def here(self, page: str) -> None:
        """Record a report of the page; ignored if no block needs that page."""
        if page == self._page:
            self._heard = time.monotonic()

    @contextmanager
    def needed(self, page: str, stop: Callable[[], None]) -> Iterator[None]:
        """Call `stop` when the page is gone, until the block has ended.

        Raises
        ------
        Fault
            The page was gone, whether the block failed or not.
        """
        self._page, self._heard = page, time.monotonic()
        ended, gone = threading.Event(), threading.Event()

        def watch() -> None:
            while not ended.wait(LOOKS_SECONDS):
                if time.monotonic() - self._heard > GONE_SECONDS:
                    gone.set()
                    with suppress(FootscanError):  # the state reports it
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
