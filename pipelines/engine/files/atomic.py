"""Writing files so that a reader meets the old content or the new, never a part."""

import contextlib
import os
import threading
from pathlib import Path

from schemas.base.errors import Fault


def write_atomically(path: Path, data: bytes) -> None:
    """Write `data` to a file beside `path`, then give it that name. Fault where the disk refuses.

    File and missing folders are never for all users; the process's umask says whether they are for its group.

    A symbolic link stays one: what it points to is written. A device or a pipe is written into.
    """
    try:
        if is_stream(path):
            with path.open("ab") as stream:
                stream.write(data)
        else:
            _replace(path.resolve(), data)
    except OSError as error:
        raise Fault(f"{path}: cannot be written ({error.strerror or error})") from None


STREAMS = {Path("/dev"), Path("/dev/fd")}
"""Folders of names that stand for what is open already, as /dev/stdout does."""


def is_stream(path: Path) -> bool:
    """Whether a path is a device or a pipe, which may have any name."""
    return path.parent in STREAMS or (path.exists() and not path.is_file() and not path.is_dir())


def _replace(path: Path, data: bytes) -> None:
    partial = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.partial")
    try:
        _make(path.parent)
        with contextlib.suppress(FileNotFoundError):
            partial.unlink()  # of a killed process that had the same number
        os.close(os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o660))
        partial.write_bytes(data)
        partial.replace(path)
    finally:
        with contextlib.suppress(OSError):
            partial.unlink()  # there after a failure or an interruption only


def _make(folder: Path) -> None:
    if not folder.is_dir():
        _make(folder.parent)
        folder.mkdir(mode=0o770, exist_ok=True)
