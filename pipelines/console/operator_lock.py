"""Which page is in charge: one operator at a time, others see the state and may take over."""

import time
from collections import Counter
from collections.abc import Callable

from schemas.base.errors import RefusedInput

GONE_SECONDS = 8.0
"""A page that was closed for so long is in charge no more; one that is loaded anew is back sooner."""


class Charge:
    """Knows the pages that look, and the one in charge. Not for several threads at once."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._pages: Counter[str] = Counter()
        self._holder: str | None = None
        self._left = 0.0

    @property
    def holder(self) -> str | None:
        """The page in charge; None where there is none, or it is gone."""
        if self._holder is not None and not self._pages[self._holder] and self._clock() - self._left > GONE_SECONDS:
            self._holder = None
        return self._holder

    def enter(self, page: str) -> None:
        """A page looks now; the first one is in charge."""
        self._pages[page] += 1
        if self.holder is None:
            self._holder = page

    def leave(self, page: str) -> None:
        """A page looks no more."""
        self._pages[page] -= 1
        if not self._pages[page]:
            del self._pages[page]
            self._left = self._clock() if page == self._holder else self._left

    def take(self, page: str) -> None:
        """A page takes over."""
        self._holder = page
        self._left = self._clock()

    def need(self, page: str) -> None:
        """Refuses a page that is not in charge; one that finds nobody so is from now on."""
        if self.holder is None:
            self.take(page)
        if self._holder != page:
            raise RefusedInput("page", "another one is in charge of the scanner, expected to take over first")
