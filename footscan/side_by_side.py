"""Work side by side on the cores of this machine: compiled loops, NumPy and image libraries release Python's lock."""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import pairwise
from typing import Any, TypeVar

import numba
import numpy as np
from numpy.typing import NDArray

FEWEST = 500
"""Rows that a thread is worth. Chosen by hand."""

_Result = TypeVar("_Result")
Arrays = tuple[NDArray[Any], ...]


def cores() -> int:
    """Number of threads: `NUMBA_NUM_THREADS`, or the cores that this process may use."""
    return int(numba.config.NUMBA_NUM_THREADS)


def together(calls: Iterable[Callable[[], _Result]]) -> list[_Result]:
    """The results of all calls, in their order; each may run on another thread.

    >>> together([lambda: 1, lambda: 2])
    [1, 2]
    """
    with ThreadPoolExecutor(cores()) as threads:
        return [future.result() for future in [threads.submit(call) for call in calls]]


def in_pieces(count: int, work: Callable[[slice], Arrays]) -> Arrays:
    """Arrays over `count` rows, of which `work` makes a piece at a time, on several threads.

    The pieces must not depend on each other: the result is then the same for any number of them.

    >>> squares, _ = in_pieces(2000, lambda rows: (np.arange(2000)[rows] ** 2, np.zeros(2000)[rows]))
    >>> len(squares), int(squares[1999])
    (2000, 3996001)
    """
    pieces = max(min(cores(), count // FEWEST), 1)
    if pieces == 1:
        return work(slice(0, count))
    bounds = np.linspace(0, count, pieces + 1).astype(int).tolist()
    made = together(partial(work, slice(start, end)) for start, end in pairwise(bounds))
    return tuple(np.concatenate(parts) for parts in zip(*made, strict=True))
