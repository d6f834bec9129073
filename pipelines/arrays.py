"""Arrays as bytes and back: the same bytes for the same arrays, and nothing in them that could run."""

import io
import zipfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schemas.base.errors import DamagedError

Array = NDArray[np.generic]


def pack(**arrays: Array) -> bytes:
    """Named arrays as an uncompressed NPZ archive (whose entries bear a fixed date)."""
    out = io.BytesIO()
    np.savez(out, allow_pickle=False, **{name: np.ascontiguousarray(array) for name, array in arrays.items()})
    return out.getvalue()


def unpack(data: bytes) -> dict[str, NDArray[Any]]:
    """The arrays of `pack`."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (ValueError, OSError, zipfile.BadZipFile) as error:
        raise DamagedError(f"expected packed arrays ({error})") from None
