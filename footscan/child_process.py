"""Processes of a pool that end with their parent."""

import os
import threading
from multiprocessing import parent_process
from multiprocessing.connection import Connection, wait


def end_with_parent(pipe: "Connection[object, object] | None" = None) -> None:
    """End this process when its parent ends: a pool that is killed cannot end its processes, which would wait forever.

    It also ends when the parent closes its end of the `pipe`. Does nothing in a process without a parent.
    """
    threading.Thread(target=_wait_and_end, args=(pipe,), name="end with the parent", daemon=True).start()


def _wait_and_end(pipe: "Connection[object, object] | None") -> None:
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel] if pipe is None else [parent.sentinel, pipe])
        os._exit(1)
