"""Digests of bytes, and the state of a file by which a change is seen."""

import hashlib
import os
import time
from pathlib import Path
from typing import NamedTuple

SETTLED_NS = 2_000_000_000
"""A file younger than this may change again within its time stamp's resolution: its digest is not remembered."""


class FileState(NamedTuple):
    """What the file system says of a file; a change of content changes it (ctime cannot be set back)."""

    size: int
    mtime_ns: int
    ctime_ns: int
    inode: int


def sha256(data: bytes) -> str:
    """Hexadecimal SHA-256 of `data`."""
    return hashlib.sha256(data).hexdigest()


def file_state(path: Path) -> FileState:
    """The present state of a file; OSError where there is none."""
    status = path.stat()
    return FileState(status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino)


def is_settled(state: FileState) -> bool:
    """Whether a further change of the file would change its state, too."""
    return time.time_ns() - max(state.mtime_ns, state.ctime_ns) > SETTLED_NS


def state_of_open(descriptor: int) -> FileState:
    """The present state of a file that is open."""
    status = os.fstat(descriptor)
    return FileState(status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino)
