"""Compile the loops of a scan before they are called, on all cores.

Compiled one after the other as they are first called, they take a minute and more on a machine that is new. Here
processes share them. What is compiled is kept where `footscan.compiled` keeps it, so it is never stale; the list of
argument types is only a matter of speed: what it lacks is compiled when it is called.

    python -m footscan.ahead_of_time
"""

import gc
import importlib
import json
import logging
import signal
import sys
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from hashlib import sha256
from importlib.resources import files
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numba
from llvmlite import binding
from numba import types

from footscan.child_process import end_with_parent
from footscan.compiled import code_folder, code_place
from footscan.side_by_side import cores

log = logging.getLogger("footscan.compiled")

LIST = "loops.json"
"""Module, name and argument types of each loop of a scan that Python calls, the slowest to compile first."""

Spec = str | dict[str, Any]


def compile_ahead() -> None:
    """Compile the listed loops on all cores, unless that was done on this machine for these sources."""
    mark = _mark()
    if mark is None or mark.exists():
        return
    processes = ProcessPoolExecutor(cores(), get_context("spawn"), _begin)
    try:
        compiled = [processes.submit(_compile, *loop) for loop in _listed()]
        problems = [repr(problem) for loop in compiled if (problem := loop.exception()) is not None]
    finally:
        processes.shutdown(cancel_futures=True)  # after an interrupt, what has begun ends, and no more begins
    if problems:
        log.warning("%d of %d loops were not compiled ahead: %s", len(problems), len(compiled), problems[0])
        return
    with suppress(OSError):
        mark.touch()


def is_compiled() -> bool:
    """True if `compile_ahead` has nothing to do."""
    mark = _mark()
    return mark is None or mark.exists()


def spec_of(argument: types.Type) -> Spec:
    """The argument type as JSON.

    >>> spec_of(types.Array(types.float64, 2, "C"))
    'float64 2 C'
    """
    if isinstance(argument, types.Array):
        constant = "" if argument.mutable else " constant"
        return f"{argument.dtype} {argument.ndim} {argument.layout}{constant}"
    if isinstance(argument, types.BaseNamedTuple):
        kind = argument.instance_class
        return {"class": f"{kind.__module__} {kind.__qualname__}", "types": [spec_of(part) for part in argument]}
    if isinstance(argument, types.BaseTuple):
        return {"types": [spec_of(part) for part in argument]}
    return str(argument)


def type_of(spec: Spec) -> types.Type:
    """The argument type that `spec_of` wrote.

    >>> spec = spec_of(types.UniTuple(types.int64, 2))
    >>> type_of(spec) == types.UniTuple(types.int64, 2)
    True
    """
    if isinstance(spec, str):
        name, *array = spec.split()
        scalar = getattr(types, name.replace("bool", "boolean"))
        return types.Array(scalar, int(array[0]), array[1], readonly=len(array) > 2) if array else scalar
    parts = [type_of(part) for part in spec["types"]]
    if "class" not in spec:
        return types.BaseTuple.from_types(parts)
    module, name = spec["class"].split()
    return types.BaseTuple.from_types(parts, getattr(importlib.import_module(module), name))


def _begin() -> None:
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C in a terminal ends it at once and without a traceback
    gc.disable()  # numba's many small objects: collecting takes an eighth of the time, and saves 600 MB of 1400 in all


def _compile(module: str, name: str, arguments: list[Spec]) -> None:
    loop = getattr(importlib.import_module(module), name)
    loop.compile(tuple(type_of(argument) for argument in arguments))


def _listed() -> list[tuple[str, str, list[Spec]]]:
    return [tuple(entry) for entry in json.loads(files("footscan").joinpath(LIST).read_text("utf-8"))]


def _mark() -> Path | None:
    """The file that says that all is compiled for these sources, numba and processor; None without a place for it."""
    place = code_place()
    if place is None:
        return None
    root = Path(__file__).parents[1]
    modules = sorted({module for module, _, _ in _listed()})
    folders = [code_folder(module, root.joinpath(*module.split(".")).with_suffix(".py")) for module in modules]
    about = [numba.__version__, binding.get_host_cpu_name(), sys.version, *map(str, folders)]
    return place / f"ahead-{sha256(' '.join(about).encode()).hexdigest()[:16]}"


if __name__ == "__main__":
    compile_ahead()
