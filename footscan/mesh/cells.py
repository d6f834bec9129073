"""Averaging of points within the cells of a grid."""

import numpy as np
from numpy.typing import NDArray


def group_by_cell(points: NDArray[np.float64], cell: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Which points share a cell of a grid with edges `cell`, anchored at the origin.

    Parameters
    ----------
    points : (N, D) coordinates
    cell : (D,) edge lengths

    Returns
    -------
    order : (N,) indices that bring points of one cell together, earlier points first
    starts : (C,) where in `order` each cell begins
    """
    keys = np.floor(points / cell).astype(np.int64)
    order = np.lexsort(keys.T)
    sorted_keys = keys[order]
    changes = np.any(sorted_keys[1:] != sorted_keys[:-1], axis=1)
    return order, np.flatnonzero(np.concatenate([np.ones(min(1, len(points)), np.bool_), changes]))


def cell_means(
    values: NDArray[np.float64], order: NDArray[np.intp], starts: NDArray[np.intp], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(C, K) weighted means over the cells of `group_by_cell` of (N, K) `values` with (N,) `weights`."""
    weighted = np.add.reduceat(values[order] * weights[order, None], starts, axis=0)
    mean: NDArray[np.float64] = weighted / np.add.reduceat(weights[order], starts)[:, None]
    return mean
