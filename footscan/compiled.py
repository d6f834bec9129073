"""Loops compiled to machine code, which is kept on disk in one place of the user's own.

numba looks for a newer version at the file of a function alone, and would go on with old machine code where a module
changed that the function takes a constant or another compiled function from. Here the code of a module lies in a folder
that is named for the digest of the module and of all modules of its package that it reaches by import.

What numba keeps is a pickle: whoever can write there runs code as the user who loads it. So a folder that others own,
or can write to, is not used.
"""

import hashlib
import logging
import os
import re
import shutil
import stat
import time
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core.caching import FunctionCache

log = logging.getLogger("footscan.compiled")

_Function = TypeVar("_Function", bound=Callable[..., object])

IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+(?P<origin>[\w.]+)[ \t]+import[ \t]+(?P<names>\([^)]*\)|[^\n]*)"
    r"|import[ \t]+(?P<module>[\w.]+))",
    re.MULTILINE,
)
KEPT_SECONDS = 30 * 86400
"""How long the machine code of earlier sources is kept: a developer goes back and forth between branches."""
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def compiled(function: _Function) -> _Function:
    """The function compiled at its first call, without Python's global lock.

    Plain loops compile fastest: an array assigned to a slice, `np.linalg.solve` and `np.sort` cost 1 to 3 s each.
    """
    made: Any = numba.njit(nogil=True)(function)
    if code_folder(function.__module__, Path(function.__code__.co_filename)) is not None:
        # As `cache=True` does, but for the folder: numba's own setting for that holds for all threads and libraries.
        made._cache = _ModuleCache(function)
    kept: _Function = made
    return kept


class _ModuleLocator:
    """Tells numba where the machine code of a function is kept."""

    def __init__(self, function: Callable[..., object], file: str) -> None:
        self._py_file = file  # numba's warnings name it
        self._line = function.__code__.co_firstlineno
        folder = code_folder(function.__module__, Path(file))
        if folder is None:
            raise RuntimeError(f"{file}: its machine code is kept nowhere")
        self._folder = folder

    @classmethod
    def from_function(cls, function: Callable[..., object], file: str) -> "_ModuleLocator":
        return cls(function, file)

    def ensure_cache_path(self) -> None:
        _make(self._folder)  # a person may have deleted it meanwhile

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """The same for equal sources, whenever and wherever they were written: two checkouts share what is equal."""
        return self._folder.name

    def get_disambiguator(self) -> str:
        return str(self._line)


class _ModuleImplementation(FunctionCache._impl_class):  # type: ignore[misc]  # numba has no types
    _locator_classes = (_ModuleLocator,)


class _ModuleCache(FunctionCache):  # type: ignore[misc]  # as above
    _impl_class = _ModuleImplementation


@lru_cache
def code_folder(module: str, file: Path) -> Path | None:
    """Where the machine code of a module's functions is kept; None where no place is safe."""
    place = code_place()
    if place is None:
        return None
    folder = place / f"{module}-{_digest_of_closure(module, file)[:16]}"
    if not folder.is_dir():
        _drop_old(place, module)
    problem = _problem(folder)
    if problem is not None:
        _warn(problem)
        return None
    return folder


def _drop_old(place: Path, module: str) -> None:
    """Remove the machine code of earlier sources of a module; a checkout that still has them compiles them again."""
    for folder in place.glob(f"{module}-*"):
        with suppress(OSError):  # another program may be doing the same
            if time.time() - folder.stat().st_mtime > KEPT_SECONDS:
                shutil.rmtree(folder)


def _digest_of_closure(module: str, file: Path) -> str:
    """SHA-256 over the sources of a module and of what it reaches by import in its own package."""
    root = file.parents[module.count(".")]
    waiting, found = [module], {}
    while waiting:
        name = waiting.pop()
        if name not in found:
            found[name], imported = _source(root, name)
            waiting += imported
    return hashlib.sha256("".join(f"{name} {found[name]}\n" for name in sorted(found)).encode()).hexdigest()


@lru_cache
def _source(root: Path, module: str) -> tuple[str, tuple[str, ...]]:
    """The digest of a module's source, and the names of its own package in its import statements.

    A statement in a text counts as well: one module too many in a closure costs a compilation, one too few a wrong
    result. A package and a name that is not a module have no source.
    """
    place = root.joinpath(*module.split("."))
    try:
        source = place.with_suffix(".py").read_bytes()
    except OSError:
        return "", ()
    package = module.partition(".")[0]
    names: set[str] = set()
    for match in IMPORT.finditer(source.decode()):
        origin = match["origin"] or match["module"]
        if origin.partition(".")[0] == package:
            names |= {origin, *(f"{origin}.{name}" for name in re.findall(r"\w+", match["names"] or ""))}
    return hashlib.sha256(source).hexdigest(), tuple(sorted(names))


@lru_cache
def code_place() -> Path | None:
    """The folder that `NUMBA_CACHE_DIR` names, otherwise one in the user's cache; settled at its first use."""
    if given := numba.config.CACHE_DIR:
        return Path(given).absolute()
    cache = Path(os.environ.get("XDG_CACHE_HOME", ""))
    try:
        cache = cache if cache.is_absolute() else Path.home() / ".cache"  # a relative one is to be ignored, says XDG
    except RuntimeError:
        cache = Path()
    if not cache.is_absolute():
        _warn("this user has no home")
        return None
    return cache / "footscan" / "compiled"


def _problem(folder: Path) -> str | None:
    """Why others may have written what is loaded from a folder, which is made; None where only this user can."""
    try:
        _make(folder)
        if not os.access(folder, os.W_OK):
            return f"{folder}: cannot be written"
        if not hasattr(os, "geteuid"):  # Windows: the user's profile is the user's own
            return None
        above, here = folder.parent.stat(), folder.lstat()
    except OSError as error:
        return f"{folder}: {error.strerror or error}"
    if above.st_uid not in (0, os.geteuid()) or here.st_uid != os.geteuid():
        return f"{folder}: belongs to another user"
    if here.st_mode & OTHERS_WRITE or (above.st_mode & OTHERS_WRITE and not above.st_mode & stat.S_ISVTX):
        return f"{folder}: other users can write to it"
    return None


def _make(folder: Path) -> None:
    """Make a folder that is the user's alone, and those above it likewise."""
    if not folder.is_dir():
        _make(folder.parent)
        folder.mkdir(mode=0o700, exist_ok=True)


@lru_cache
def _warn(problem: str) -> None:
    log.warning(
        "%s: machine code is not kept, and compiled at every start; expected a folder of your own in NUMBA_CACHE_DIR",
        problem,
    )
