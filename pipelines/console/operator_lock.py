"""The page that is in charge: one operator at a time; other pages see the state and may take over."""

import time
from collections import Counter
from collections.abc import Callable

from schemas.base.errors import RefusedInput

GONE_SECONDS = 8.0
"""A page that was closed for this long loses charge. A page that is reloaded is back sooner; chosen by hand."""


class OperatorLock:
    """The open pages, and the page in charge. Not safe for several threads at once."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._pages: Counter[str] = Counter()
        self._holder: str | None = None
        self._left = 0.0

    @property
    def holder(self) -> str | None:
        """The page in charge; None if there is none, or it is gone."""
        if self._holder is not None and not self._pages[self._holder] and self._clock() - self._left > GONE_SECONDS:
            self._holder = None
        return self._holder

    def enter(self, page: str) -> None:
        """Register a page; the first one is in charge."""
        self._pages[page] += 1
        if self.holder is None:
            self._holder = page

    def leave(self, page: str) -> None:
        """Unregister a page."""
        self._pages[page] -= 1
        if not self._pages[page]:
            del self._pages[page]
            self._left = self._clock() if page == self._holder else self._left

    def take(self, page: str) -> None:
        """Put a page in charge."""
        self._holder = page
        self._left = self._clock()

    def need(self, page: str) -> None:
        """Refuse a page if another one is in charge; if none is, put this page in charge."""
        if self.holder is None:
            self.take(page)
        if self._holder != page:
            raise RefusedInput("page", "another page is in charge of the scanner, expected to take over first")
