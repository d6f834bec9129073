"""Digests of bytes, and the state of a file, which shows a change."""

import hashlib
import os
import time
from pathlib import Path
from typing import NamedTuple

SETTLED_NS = 2_000_000_000
"""Smallest age of a file, ns, whose digest is remembered; chosen by hand.

A younger file may change again within the resolution of its time stamp, which is 2 s on FAT.
"""


class FileState(NamedTuple):
    """The metadata of a file that change with its content; ctime cannot be set back."""

    size: int
    mtime_ns: int
    ctime_ns: int
    inode: int


def sha256(data: bytes) -> str:
    """Hexadecimal SHA-256 of `data`."""
    return hashlib.sha256(data).hexdigest()


def file_state(path: Path) -> FileState:
    """Return the present state of a file; OSError if it does not exist."""
    status = path.stat()
    return FileState(status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino)


def is_settled(state: FileState) -> bool:
    """Return True if a further change of the file would change its state."""
    return time.time_ns() - max(state.mtime_ns, state.ctime_ns) > SETTLED_NS


def state_of_open(descriptor: int) -> FileState:
    """Return the present state of an open file."""
    status = os.fstat(descriptor)
    return FileState(status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino)
