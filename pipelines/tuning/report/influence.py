"""Influence of a parameter: its share of the variance of an objective over the trials."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

CLASSES = 5
"""Number of classes of equal count into which numeric values are divided; chosen by hand."""
FEWEST = 8
"""Least number of trials for a statement; chosen by hand."""


def share_of_variance(parameter: Sequence[Any], values: Sequence[float]) -> float | None:
    """Share, 0 to 1, of the variance of the ranks of `values` that lies between classes of the parameter.

    Numbers are divided into classes of equal count, so that an optimum in the middle of the range counts, too. Ranks
    are used because a failed trial must not outweigh all others. The share that classes explain by chance is subtracted
    (epsilon squared: Kelley, "An unbiased correlation ratio measure", PNAS 1935, doi:10.1073/pnas.21.9.554). None if
    there are too few trials, or if they are all equal.

    >>> share_of_variance([1, 1, 1, 1, 2, 2, 2, 2], [1.0, 1.0, 1.0, 1.0, 5.0, 5.0, 5.0, 5.0])
    1.0
    >>> share_of_variance([1, 2], [1.0, 5.0]) is None
    True
    """
    count = len(values)
    ranks = rankdata(values)
    total = float(np.sum((ranks - ranks.mean()) ** 2))
    if count < FEWEST or not total:
        return None
    classes = _classes(parameter)
    groups = len(np.unique(classes))
    if groups < 2 or groups == count:
        return None
    means = np.bincount(classes, ranks) / np.maximum(np.bincount(classes), 1)
    within = float(np.sum((ranks - means[classes]) ** 2))
    return max(0.0, 1 - within / (count - groups) * (count - 1) / total)


def _classes(parameter: Sequence[Any]) -> NDArray[np.intp]:
    """Number of the class of each value, (N,)."""
    numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in parameter)
    if numbers and len(set(parameter)) > CLASSES:
        return np.asarray((rankdata(parameter) - 1) * CLASSES // len(parameter), np.intp)
    names = [str(value) for value in parameter]
    order = {name: place for place, name in enumerate(dict.fromkeys(names))}
    return np.array([order[name] for name in names], np.intp)
