"""The Pareto front of trials, and the one of them that is taken."""

from collections.abc import Sequence
from math import prod


def on_front(values: Sequence[Sequence[float]]) -> set[int]:
    """Numbers of those that no other is as good as in all and better than in something; less is better."""
    return {
        number
        for number, own in enumerate(values)
        if not any(
            all(a <= b for a, b in zip(other, own, strict=True)) and list(other) != list(own) for other in values
        )
    }


def best_compromise(values: Sequence[Sequence[float]], floors: Sequence[float], front: set[int]) -> int:
    """The number of the one on the front with the least product of all its values.

    So a hundredth of one objective is worth a hundredth of another, whatever their units. Below its floor no value
    is better than another. Of equal ones the first is taken: what is there already, where nothing is better.
    """

    def product(number: int) -> float:
        return prod(max(value, floor) for value, floor in zip(values[number], floors, strict=True))

    return min(sorted(front), key=product)
