"""Progress of long work, for whoever looks at it."""

from collections.abc import Callable

OnProgress = Callable[[int, int], None]
"""Called with how much is done, and with how much there is."""


def unheard(done: int, total: int) -> None:
    """Progress that nobody looks at."""
