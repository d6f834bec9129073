"""The rails of the virtual scanner: three heads with their end switches, end stops and mishaps, as they really stand.

Rail coordinates, mm: as the firmware counts after a perfect homing. 0 is where the home switch trips, the far switch
trips at `-LENGTH_MM`; stops of rubber stand `BEYOND_MM` behind either.
"""

import math
from dataclasses import dataclass, field

Triple = tuple[float, float, float]

LENGTH_MM = 440.0
"""Between the two switches of a rail."""
BEYOND_MM = 4.0
ROUNDING_MM = 1e-9
SLIDE_SECONDS = 0.004
"""How long a head slides on when its pulses stop at once: steps that the motor makes and nobody counts."""


@dataclass(frozen=True)
class Mount:
    """How a head's rail lies in the world: X = `offset_mm` + `direction` x rail coordinate."""

    offset_mm: float
    direction: int = -1

    def world(self, rail_mm: float) -> float:
        """World X of a head that stands at `rail_mm`."""
        return self.offset_mm + self.direction * rail_mm


@dataclass
class Rail:
    """One head's rail."""

    stuck: bool = False
    """Whether the head stands still although its motor is driven."""
    broken_switches: bool = False
    """Whether its switches never trip."""
    welded_switches: bool = False
    """Whether its switches never open."""

    def switch_pressed(self, rail_mm: float) -> bool:
        """Whether one of the two switches is pressed where the head stands."""
        if self.welded_switches:
            return True
        return not self.broken_switches and (rail_mm >= -ROUNDING_MM or rail_mm <= ROUNDING_MM - LENGTH_MM)

    def after(self, rail_mm: float, moved_mm: float) -> float:
        """Where a head stands that its motor moved on by `moved_mm`."""
        return rail_mm if self.stuck else self.within_stops(rail_mm + moved_mm)

    def within_stops(self, rail_mm: float) -> float:
        """Where a head comes to stand that is driven to `rail_mm`."""
        return min(max(rail_mm, -LENGTH_MM - BEYOND_MM), BEYOND_MM)

    def seconds_to_switch(self, rail_mm: float, speed: float, acceleration: float) -> float:
        """When an open switch will be pressed, s from now; infinite where it will not be."""
        if self.stuck or self.broken_switches or self.welded_switches:
            return math.inf
        return min(
            _seconds_to_go(0.0 - rail_mm, speed, acceleration),
            _seconds_to_go(rail_mm + LENGTH_MM, -speed, -acceleration),
        )


@dataclass
class Gait:
    """How evenly motors turn: `ripple` is the part of the speed that swings `per_second` times a second.

    The firmware counts the steps it gives, so what it reports has the same ripple; pauses stop its step generator.
    """

    ripple: float = 0.0
    per_second: float = 1.0
    pauses: list[tuple[float, float]] = field(default_factory=list)
    """Each from when, s, and how long, s."""

    def motion_seconds(self, seconds: float) -> float:
        """The time on the clock of the motion at world time `seconds`: never decreasing, with mean rate 1."""
        paused = sum(min(max(seconds - begin, 0.0), length) for begin, length in self.pauses)
        turned = 2.0 * math.pi * self.per_second * (seconds - paused)
        return seconds - paused + self.ripple * (1.0 - math.cos(turned)) / (2.0 * math.pi * self.per_second)


def _seconds_to_go(distance: float, speed: float, acceleration: float) -> float:
    """The smallest t > 0 with speed t + acceleration t^2 / 2 = distance; infinite where there is none."""
    if distance <= 0.0:
        return math.inf  # pressed already
    if abs(acceleration) < 1e-12:
        return distance / speed if speed > 0.0 else math.inf
    under = speed * speed + 2.0 * acceleration * distance
    if under < 0.0:
        return math.inf
    root = math.sqrt(under)
    times = [t for t in ((-speed + root) / acceleration, (-speed - root) / acceleration) if t > 0.0]
    return min(times, default=math.inf)
