"""Arrays as bytes and back. Equal arrays give equal bytes, and the bytes cannot hold code."""

import io
import zipfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from footscan.syntax_lock import SYNTAX_LOCK
from schemas.base.errors import DamagedError

Array = NDArray[np.generic]


def pack(**arrays: Array) -> bytes:
    """Pack named arrays into an uncompressed NPZ archive, whose entries have a fixed date.

    Examples
    --------
    >>> unpack(pack(x=np.array([1, 2], np.int32)))
    {'x': array([1, 2], dtype=int32)}
    """
    out = io.BytesIO()
    np.savez(out, allow_pickle=False, **{name: np.ascontiguousarray(array) for name, array in arrays.items()})
    return out.getvalue()


def unpack(data: bytes) -> dict[str, NDArray[Any]]:
    """Restore the arrays of `pack`; DamagedError if `data` is not such an archive."""
    try:
        with SYNTAX_LOCK, np.load(io.BytesIO(data), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (ValueError, OSError, zipfile.BadZipFile) as error:
        raise DamagedError(f"expected packed arrays ({error})") from None
