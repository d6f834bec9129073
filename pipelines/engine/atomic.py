"""Writing files so that a reader meets the old content or the new, never a part."""

import contextlib
import os
import threading
from pathlib import Path

from schemas.errors import Fault


def write_atomically(path: Path, data: bytes) -> None:
    """Write `data` to a file beside `path`, then give it that name. Fault where the disk refuses."""
    partial = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_bytes(data)
        partial.replace(path)
    except OSError as error:
        raise Fault(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        with contextlib.suppress(OSError):
            partial.unlink()  # there after a failure or an interruption only
