"""Processes of a pool that end with their parent."""

import os
import threading
from multiprocessing import parent_process


def end_with_parent() -> None:
    """End this process when its parent ends: a pool that is killed cannot end its processes, which would wait forever.

    Does nothing in a process without a parent.
    """
    threading.Thread(target=_wait_and_end, name="end with the parent", daemon=True).start()


def _wait_and_end() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
