"""Loops compiled to machine code, which is kept on disk.

numba looks for a newer version at the file of a function alone, and would go on with old machine code where a module
changed that the function takes a constant or another compiled function from. Here the code of a room lies in a folder
that is named for the digest of all its modules. Compiled functions therefore call none of another room.
"""

import hashlib
import os
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

import numba

_Function = TypeVar("_Function", bound=Callable[..., object])


def compiled(function: _Function) -> _Function:
    """The function compiled at its first call, without Python's global lock."""
    room = Path(function.__code__.co_filename).parent
    folder = _folder(room)
    known = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder or "")
    try:
        made: _Function = numba.njit(cache=folder is not None, nogil=True)(function)
    finally:
        numba.config.CACHE_DIR = known
    return made


@lru_cache
def _folder(room: Path) -> Path | None:
    """Where the machine code of a room's functions is kept: beside them, otherwise in the user's cache, or nowhere."""
    digest = hashlib.sha256()
    for module in sorted(room.glob("*.py")):
        digest.update(module.read_bytes())
    name = f"{room.name}-{digest.hexdigest()[:16]}"
    given = numba.config.CACHE_DIR
    places = [Path(given)] if given else [room / "__pycache__", Path.home() / ".cache" / "footscan"]
    for place in places:
        try:
            (place / name).mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(place / name, os.W_OK):
            return place / name
    return None
