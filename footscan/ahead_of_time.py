"""Compile the loops of a scan, and those of the virtual scanner, before they are called, on all cores.

Compiled one after the other as they are first called, they take a minute and more on a machine that is new. Here
processes share them, while the program goes on. What is compiled is kept where `footscan.compiled` keeps it, so it is
never stale; the lists of argument types are only a matter of speed: what they lack is compiled when it is called.

    python -m footscan.ahead_of_time
"""

import gc
import importlib
import json
import logging
import os
import signal
import sys
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, wait
from contextlib import ExitStack, suppress
from hashlib import sha256
from importlib.resources import files
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Self

import numba
from llvmlite import binding
from numba import types

from footscan.child_process import end_with_parent
from footscan.compiled import code_folder, code_place
from footscan.side_by_side import cores

log = logging.getLogger("footscan.compiled")

SCAN, VIRTUAL = "loops.json", "virtual/loops.json"
"""The lists, relative to this package: module, name and argument types of each loop that Python calls, the slowest to
compile first."""
SECONDS = {SCAN: 30, VIRTUAL: 10}
"""What compiling a list takes on two cores, about."""
LOOK_SECONDS = 0.1
"""Interval at which `Compilation.wait` calls its caller; chosen by hand."""
POLITE = 19
"""Niceness of processes in the background: that of a virtual scanner's pictures is less. Chosen by hand."""

Spec = str | dict[str, Any]


class Compilation:
    """Compiles the loops of lists on all cores, unless that was done on this machine for these sources.

    A context manager, which ends what is not compiled then. In the background it takes the time that others leave.
    """

    def __init__(self, *lists: str, in_background: bool = False) -> None:
        self._open = ExitStack()
        self._lists = [name for name in lists if not is_compiled(name)]
        self._loops: list[Future[None]] = []
        if self._lists:
            context = get_context("spawn")
            childrens_end, own_end = context.Pipe(duplex=False)
            self._open.enter_context(childrens_end)
            processes = self._open.enter_context(
                ProcessPoolExecutor(cores(), context, _begin, (childrens_end, in_background))
            )
            self._open.enter_context(own_end)
            self._loops = [processes.submit(_compile, *loop) for name in self._lists for loop in _listed(name)]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._loops = []
        self._open.close()

    @property
    def is_done(self) -> bool:
        """True if all loops are compiled; usable from any thread."""
        if self._loops and all(loop.done() for loop in self._loops):
            self.wait()
        return not self._lists

    def wait(self, on_look: Callable[[], None] = lambda: None) -> None:
        """Wait until all loops are compiled; `on_look` is called meanwhile, and may end the wait by an exception."""
        loops, lists = self._loops, self._lists
        if not loops:
            return
        while wait(loops, LOOK_SECONDS).not_done:
            on_look()
        problems = [repr(problem) for loop in loops if (problem := loop.exception()) is not None]
        if problems:
            log.warning("%d of %d loops were not compiled ahead: %s", len(problems), len(loops), problems[0])
        else:
            for mark in map(_mark, lists):
                if mark is not None:
                    with suppress(OSError):
                        mark.touch()
        self._lists, self._loops = [], []
        self._open.close()


def is_compiled(name: str) -> bool:
    """True if a list is compiled on this machine for these sources, or if nothing can be kept."""
    mark = _mark(name)
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


def _begin(pipe: "Connection[object, object]", in_background: bool) -> None:
    end_with_parent(pipe)
    if in_background and hasattr(os, "nice"):
        os.nice(POLITE)
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C in a terminal ends it at once and without a traceback
    gc.disable()  # numba's many small objects: collecting takes an eighth of the time, and saves 600 MB of 1400 in all


def _compile(module: str, name: str, arguments: list[Spec]) -> None:
    loop = getattr(importlib.import_module(module), name)
    loop.compile(tuple(type_of(argument) for argument in arguments))


def _listed(name: str) -> list[tuple[str, str, list[Spec]]]:
    return [tuple(entry) for entry in json.loads(files("footscan").joinpath(name).read_text("utf-8"))]


def _mark(name: str) -> Path | None:
    """The file that says that a list is compiled for these sources, numba and processor; None without a place."""
    place = code_place()
    if place is None:
        return None
    root = Path(__file__).parents[1]
    modules = sorted({module for module, _, _ in _listed(name)})
    folders = [code_folder(module, root.joinpath(*module.split(".")).with_suffix(".py")) for module in modules]
    about = [numba.__version__, binding.get_host_cpu_name(), sys.version, *map(str, folders)]
    return place / f"ahead-{sha256(' '.join(about).encode()).hexdigest()[:16]}"


if __name__ == "__main__":
    with Compilation(SCAN, VIRTUAL) as compilation:
        compilation.wait()
