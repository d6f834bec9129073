"""Averaging of points within the cells of a grid."""

import numpy as np
from numpy.typing import NDArray


def group_by_cell(points: NDArray[np.float64], cell: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Group points by the cells of a grid with edges `cell`, anchored at the origin.

    Parameters
    ----------
    points : (N, D) coordinates
    cell : (D,) edge lengths, in the unit of the points

    Returns
    -------
    order : (N,) indices that bring points of one cell together, earlier points first
    starts : (C,) places in `order` where each cell begins

    Examples
    --------
    >>> order, starts = group_by_cell(np.array([[0.2], [1.5], [0.7]]), np.array([1.0]))
    >>> order.tolist(), starts.tolist()
    ([0, 2, 1], [0, 2])
    """
    keys = np.floor(points / cell).astype(np.int64)
    order = np.lexsort(keys.T)
    sorted_keys = keys[order]
    changes = np.any(sorted_keys[1:] != sorted_keys[:-1], axis=1)
    return order, np.flatnonzero(np.concatenate([np.ones(min(1, len(points)), np.bool_), changes]))


def cell_means(
    values: NDArray[np.float64], order: NDArray[np.intp], starts: NDArray[np.intp], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns (C, K) weighted means of (N, K) `values` over the cells of `group_by_cell`; `weights` are (N,)."""
    weighted = np.add.reduceat(values[order] * weights[order, None], starts, axis=0)
    mean: NDArray[np.float64] = weighted / np.add.reduceat(weights[order], starts)[:, None]
    return mean
