"""Waiting for threads and hardware that tests keep time with."""

import time
from collections.abc import Callable

from schemas.base.errors import Fault

LONG_SECONDS = 60.0
"""Longer than anything takes on a machine that has other work to do."""


def wait_until(holds: Callable[[], object], case: str = "", shown: Callable[[], str] = str) -> None:
    """Waits until `holds()`; fails where it never does, and says in what `case` and what was `shown` then."""
    end = time.monotonic() + LONG_SECONDS
    while not holds():
        assert time.monotonic() < end, f"{case}; {shown()}"
        time.sleep(0.01)


def fault_of(call: Callable[[], object]) -> str:
    """What the fault said that `call` ended with; nothing where it ended well."""
    try:
        call()
    except Fault as fault:
        return str(fault)
    return ""
