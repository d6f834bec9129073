"""The Pareto front of trials, and the choice of the winner."""

from collections.abc import Sequence
from math import prod


def on_front(values: Sequence[Sequence[float]]) -> set[int]:
    """Numbers of the Pareto-optimal rows of `values`; less is better.

    A row is Pareto-optimal if no other row is at least as good in all values and better in one.

    >>> sorted(on_front([[1.0, 4.0], [2.0, 2.0], [3.0, 3.0]]))
    [0, 1]
    """
    return {
        number
        for number, own in enumerate(values)
        if not any(
            all(a <= b for a, b in zip(other, own, strict=True)) and list(other) != list(own) for other in values
        )
    }


def best_compromise(values: Sequence[Sequence[float]], floors: Sequence[float], front: set[int]) -> int:
    """Number of the row on the front with the least product of its values.

    So one percent of an objective is worth one percent of any other, regardless of units. Values below their floor
    count as the floor. Among equal rows the first wins: that of the present parameters, if nothing is better.

    >>> best_compromise([[1.0, 4.0], [2.0, 1.5], [3.0, 3.0]], [0.1, 0.1], {0, 1})
    1
    """

    def product(number: int) -> float:
        return prod(max(value, floor) for value, floor in zip(values[number], floors, strict=True))

    return min(sorted(front), key=product)
