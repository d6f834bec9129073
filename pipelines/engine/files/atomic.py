"""Atomic writes: a reader finds the old content of a file or the new one, never a part."""

import contextlib
import os
import threading
from pathlib import Path

from schemas.base.errors import Fault


def write_atomically(path: Path, data: bytes) -> None:
    """Write `data` to a temporary file beside `path`, then rename it to `path`. Missing folders are made.

    Other users get no access to new files and folders; the umask decides about the group. A symbolic link stays, and
    the file that it points to is replaced. Data are appended to a device or a pipe.

    Raises
    ------
    Fault
        The file cannot be written.
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
"""Folders whose names stand for open streams, e.g. /dev/stdout."""


def is_stream(path: Path) -> bool:
    """Return True for a device or a pipe; a pipe may have any name."""
    return path.parent in STREAMS or (path.exists() and not path.is_file() and not path.is_dir())


def _replace(path: Path, data: bytes) -> None:
    partial = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.partial")
    try:
        _make_folders(path.parent)
        with contextlib.suppress(FileNotFoundError):
            partial.unlink()  # left by a killed process with the same number
        os.close(os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o660))
        partial.write_bytes(data)
        partial.replace(path)
    finally:
        with contextlib.suppress(OSError):
            partial.unlink()  # exists only after a failure or an interruption


def _make_folders(folder: Path) -> None:
    if not folder.is_dir():
        _make_folders(folder.parent)
        folder.mkdir(mode=0o770, exist_ok=True)
