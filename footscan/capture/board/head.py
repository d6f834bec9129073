"""The rail of a head in world coordinates, and a travel along it."""

from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True)
class Head:
    """Rail of a head: its world X = `offset_mm` + `direction` x machine position of its axis."""

    offset_mm: float = -20.0
    """World X at which its home switch trips; from the calibration, it aligns the heads."""
    direction: int = -1
    """-1 if X increases away from the home switch, where machine positions decrease; 1 if X decreases."""
    axis: int = 0
    """Index of the board's axis that moves it, 0 to 2."""

    def world(self, machine_mm: float) -> float:
        """Convert a machine position to world X, mm."""
        return self.offset_mm + self.direction * machine_mm

    def machine(self, world_mm: float) -> float:
        """Convert world X to a machine position, mm."""
        return (world_mm - self.offset_mm) * self.direction


class Travel(NamedTuple):
    """Begin and end of a travel."""

    begin_seconds: float
    """`time.monotonic()` just before the heads moved."""
    end_seconds: float
    """`time.monotonic()` when the heads stood again."""
