"""Finds what reaches into a range of X, among things that each cover one."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Ranges:
    """Ranges of X that are ready to be searched many times.

    >>> ranges = Ranges(np.array([[4.0, 6.0], [0.0, 3.0], [1.0, 1.5]]))
    >>> print(ranges.within(2.0, 4.0).tolist())
    [1, 0]
    """

    def __init__(self, ranges: Floats) -> None:
        """`ranges` : (N, 2) mm, the least and the greatest X of each, N >= 1."""
        self._order = np.argsort(ranges[:, 0], kind="stable")
        self._least, self._greatest = ranges[self._order].T.copy()
        self._longest = float((ranges[:, 1] - ranges[:, 0]).max())

    def within(self, least: float, greatest: float) -> Ints:
        """Numbers (K,) of the ranges that share an X with that from `least` to `greatest`, mm, by their least X."""
        first = np.searchsorted(self._least, least - self._longest)
        last = np.searchsorted(self._least, greatest, side="right")
        return np.asarray(self._order[first:last][self._greatest[first:last] >= least])
