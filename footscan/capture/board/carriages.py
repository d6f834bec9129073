"""Heads on the axes of the board: which of them one motor moves, and where they are."""

from collections.abc import Sequence

from footscan.capture.board.head import Head
from schemas.rig import RigBoard

AXIS_LETTERS = "XYZ"


class Carriages:
    """The carriages of a scanner, one on each axis that has a head.

    Heads on one axis are of one carriage. The first of them leads: the carriage stands at X if its first head does.
    Axes without a head have no carriage, and are never moved.

    Examples
    --------
    Two heads on one axis, the second one 30 mm ahead:

    >>> both = Carriages([Head(-20.0), Head(10.0)])
    >>> both.world([-120.0, 0.0, 0.0]), both.leading([-120.0, 0.0, 0.0]), both.aside_mm(2)
    ((100.0, 130.0), [100.0], 30.0)
    """

    def __init__(self, heads: Sequence[Head]) -> None:
        self.heads = tuple(heads)
        self.leaders = {head.axis: head for head in reversed(self.heads)}
        """The leading head of each axis, by its index."""

    def reach_mm(self, setup: RigBoard) -> tuple[float, float]:
        """Return the lowest and highest world X that all carriages can reach, mm."""
        ends = [
            sorted((head.world(-setup.pull_off_mm), head.world(-setup.travel_mm[axis])))
            for axis, head in self.leaders.items()
        ]
        return max(low for low, _ in ends), min(high for _, high in ends)

    def aside_mm(self, head: int) -> float:
        """Return X of head 1, 2, ... relative to that of the head that leads its carriage, mm."""
        own = self.heads[head - 1]
        return own.offset_mm - self.leaders[own.axis].offset_mm

    def carried(self, head: int | None = None) -> list[bool]:
        """Return of each head whether it moves if head 1, 2, ... is moved, or all are."""
        return [head is None or other.axis == self.heads[head - 1].axis for other in self.heads]

    def moved(self, head: int | None = None) -> dict[int, Head]:
        """Return the axes that move if head 1, 2, ... is moved, or all are, and the leading head of each."""
        if head is None:
            return self.leaders
        axis = self.heads[head - 1].axis
        return {axis: self.leaders[axis]}

    def world(self, machine_mm: Sequence[float]) -> tuple[float, ...]:
        """Convert the machine positions of the axes to world X of all heads, mm."""
        return tuple(head.world(machine_mm[head.axis]) for head in self.heads)

    def leading(self, machine_mm: Sequence[float]) -> list[float]:
        """Convert them to world X of the heads that lead, mm; that of the first head comes first."""
        return [head.world(machine_mm[head.axis]) for head in self.heads if self.leaders[head.axis] is head]
