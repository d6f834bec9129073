"""Rows of a table: their limits, and which of them are equal."""

from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

_Scalar = TypeVar("_Scalar", bound=np.generic)


class DistinctRows(NamedTuple, Generic[_Scalar]):
    """The rows of an (N, K) table, each of them once."""

    rows: NDArray[_Scalar]
    """(M, K) in the order of their first column, then of their second, and so on."""
    first: NDArray[np.intp]
    """(M,) where each of them stands first in the table."""
    number: NDArray[np.intp]
    """(N,) which of them each row of the table is."""
    counts: NDArray[np.intp]
    """(M,) how often each of them is in the table."""


def limits(table: NDArray[_Scalar]) -> tuple[NDArray[_Scalar], NDArray[_Scalar]]:
    """Least and greatest value (K,) of each column of an (N, K) `table`, N >= 1.

    Column by column, which takes a twentieth of the time of `table.min(axis=0)` where K is small.

    >>> limits(np.array([[1, 5], [2, 3]]))
    (array([1, 3]), array([2, 5]))
    """
    return np.array([column.min() for column in table.T]), np.array([column.max() for column in table.T])


def distinct_numbers(numbers: NDArray[np.integer]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The distinct ones (M,) of small `numbers` (N,) from 0, rising, and which of them each number is (N,).

    It counts where `numpy.unique` with `return_inverse` sorts.

    >>> distinct_numbers(np.array([7, 3, 7]))
    (array([3, 7]), array([1, 0, 1]))
    """
    is_there = np.bincount(numbers) > 0
    return np.flatnonzero(is_there), (np.cumsum(is_there) - 1)[numbers]


def distinct_rows(table: NDArray[_Scalar]) -> DistinctRows[_Scalar]:
    """What `numpy.unique` with `axis=0` finds in an (N, K) `table`, four to eight times as fast, since that compares
    rows byte by byte."""
    order = np.lexsort(table.T[::-1])
    ordered = table.take(order, axis=0)  # four times as fast as in brackets
    begins = np.ones(len(table), np.bool_)
    begins[1:] = np.any([column[1:] != column[:-1] for column in ordered.T], axis=0)
    number = np.empty(len(table), np.intp)
    number[order] = np.cumsum(begins) - 1
    counts = np.diff(np.append(np.flatnonzero(begins), len(table)))
    return DistinctRows(ordered.compress(begins, axis=0), order[begins], number, counts)
