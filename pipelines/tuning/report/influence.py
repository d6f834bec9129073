"""How much of what an objective varies by, over trials, goes with one parameter."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

CLASSES = 5
"""A number's values are parted into so many of equal count."""
FEWEST = 8
"""Trials below which nothing is said."""


def share_of_variance(parameter: Sequence[Any], values: Sequence[float]) -> float | None:
    """The share, 0 to 1, of the variance of the values' ranks that lies between classes of the parameter.

    A number is parted into classes of equal count, so that an optimum in the midst of its range counts, too; ranks, for
    a trial that failed must not outweigh all others. What classes explain by chance is taken off (epsilon squared:
    Kelley, "An unbiased correlation ratio measure", PNAS 1935, doi:10.1073/pnas.21.9.554). None where too few trials,
    or equal ones, tell nothing.
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
    """The number of the class of each value."""
    numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in parameter)
    if numbers and len(set(parameter)) > CLASSES:
        return np.asarray((rankdata(parameter) - 1) * CLASSES // len(parameter), np.intp)
    names = [str(value) for value in parameter]
    order = {name: place for place, name in enumerate(dict.fromkeys(names))}
    return np.array([order[name] for name in names], np.intp)
