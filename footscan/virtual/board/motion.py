"""Motion of the virtual board over time: planned moves at constant acceleration, exact at every moment.

All times are those of the motion's clock, s. Nothing happens between two calls: `advance` computes what has happened.
"""

import math
from bisect import bisect_right
from collections import deque
from dataclasses import dataclass
from typing import Literal

from footscan.virtual.board.rails import SLIDE_SECONDS, Rail, Triple

NOTHING: Triple = (0.0, 0.0, 0.0)
SAME_WAY = 0.999_999
"""Cosine of the angle between two moves that are passed through without slowing down."""
TINY = 1e-9
KEPT = 20_000
"""Pieces of past motion that are kept: a bound of memory, far more than an hour of scanning."""

Watch = Literal["none", "limits", "homing"]


@dataclass
class LaserPower:
    """What feeds the laser's PWM: `level` is its share of full power, 0 to 1."""

    level: float = 0.0
    full_at: float | None = None
    """Speed, mm/s, at which it has that level, to fall with the speed (M4); None where it keeps it (M3)."""


@dataclass
class Move:
    """A straight move in the planner. Lengths are those of the three axes taken as one space, as the firmware does."""

    target: Triple
    unit: Triple
    length: float
    feed: float
    """Programmed speed along the move, mm/s."""
    limit: float
    """Fastest speed that all axes bear, mm/s."""
    acceleration: float
    light: LaserPower
    rapid: bool = False
    fixed_feed: bool = False
    """Whether overrides leave its speed alone (jogs, homing)."""
    exit: float = 0.0
    done: float = 0.0


@dataclass(frozen=True)
class Piece:
    """A stretch of time at one acceleration."""

    steps: Triple
    """Where the firmware counts the axes at its begin, mm."""
    rail: Triple
    """Where the heads really stand then, mm."""
    velocity: Triple
    acceleration: Triple
    light: LaserPower
    stuck: tuple[bool, bool, bool]


class Motion:
    """The planner's queue, the motors, and where they took the heads."""

    def __init__(self, rails: list[Rail], heads_at: Triple, now: float) -> None:
        self.rails = rails
        self.queue: deque[Move] = deque()
        self.holding = False
        """Whether it slows down, or stands, although there is something to do."""
        self.feed_override = 1.0
        self.rapid_override = 1.0
        self.light_override = 1.0
        self.watch: Watch = "none"
        self.tripped = False
        """Whether a switch stopped a move while limits are watched."""
        self.locked = [False, False, False]
        """Axes that get no pulses: those that found their switch while homing."""
        self.speed = 0.0
        self.standing_light = LaserPower()
        self.dark_when_held = False
        self._now = now
        self._steps: Triple = NOTHING
        self._rail: Triple = heads_at
        self._begins: list[float] = []
        self._pieces: list[Piece] = []
        self._noted: tuple[int, float] | None = None
        """The move and the acceleration of the latest piece, as long as it goes on."""
        self._note(NOTHING, NOTHING, self.standing_light)

    @property
    def is_moving(self) -> bool:
        """Whether there is something to do that nothing holds up, or the heads still slow down."""
        return bool(self.queue) and not (self.holding and self.speed == 0.0)

    @property
    def moment(self) -> float:
        """Until when everything is computed."""
        return self._now

    @property
    def steps(self) -> Triple:
        """Where the firmware counts the axes, mm."""
        return self._steps

    @steps.setter
    def steps(self, counted: Triple) -> None:
        self._steps = counted
        self._note(NOTHING, NOTHING, self.standing_light)

    def add(self, move: Move) -> None:
        """Queues a move; it begins at once unless held."""
        self.queue.append(move)
        self.plan()

    def plan(self) -> None:
        """Sets the speed at which each move passes into the next (backward pass; the last one ends at rest)."""
        after: Move | None = None
        for move in reversed(self.queue):
            if after is None or sum(a * b for a, b in zip(move.unit, after.unit, strict=True)) < SAME_WAY:
                move.exit = 0.0
            else:
                slowing = math.sqrt(after.exit**2 + 2.0 * after.acceleration * after.length)
                move.exit = min(self._nominal(move), self._nominal(after), slowing)
            after = move

    def kill(self) -> None:
        """Stops all pulses at once. The heads slide on a little, which nobody counts; the queue is lost."""
        if self.queue and self.speed > 0.0:
            unit = self.queue[0].unit
            slid = [
                0.0 if locked else SLIDE_SECONDS * self.speed * u for u, locked in zip(unit, self.locked, strict=True)
            ]
            self._rail = _triple(
                [rail.after(at, by) for rail, at, by in zip(self.rails, self._rail, slid, strict=True)]
            )
        self.flush()

    def flush(self) -> None:
        """Forgets what is queued; the heads stand."""
        self.queue.clear()
        self.speed = 0.0
        self.holding = False
        self._note(NOTHING, NOTHING, self.standing_light)

    def stand_in_light(self, light: LaserPower) -> None:
        """Sets the light of heads that stand."""
        self.standing_light = light
        if not self.is_moving:
            self._note(NOTHING, NOTHING, light)

    def stick(self, axis: int, stuck: bool) -> None:
        """From now on a head stands still although it is driven, or no longer."""
        self.rails[axis].stuck = stuck
        self._note_again()

    def push(self, axis: int, by_mm: float) -> None:
        """Moves a head by hand, or by steps that were lost: nobody counts that."""
        rail = list(self._rail)
        rail[axis] = self.rails[axis].after(rail[axis], by_mm)
        self._rail = _triple(rail)
        self._note_again()

    def pressed(self) -> tuple[bool, bool, bool]:
        """Which axes have a switch pressed."""
        a, b, c = (rail.switch_pressed(at) for rail, at in zip(self.rails, self._rail, strict=True))
        return a, b, c

    def rail_at(self, when: float) -> Triple:
        """Where the heads really stood, mm on their rails, now or in the past."""
        begin, piece = self._piece(when)
        moved = zip(self.rails, piece.rail, _moved(piece, when - begin), piece.stuck, strict=True)
        return _triple([at if stuck else rail.within_stops(at + by) for rail, at, by, stuck in moved])

    def light_at(self, when: float) -> float:
        """The laser's power, 0 to 1, now or in the past."""
        begin, piece = self._piece(when)
        level = min(piece.light.level * self.light_override, 1.0)
        if piece.light.full_at is None:
            return level
        return min(level * _speed(piece, when - begin) / piece.light.full_at, 1.0)

    def advance(self, now: float) -> None:
        """Lets time pass until `now`."""
        while self.queue and now > self._now:
            acceleration, lasting = self._phase()
            if lasting == math.inf:
                break  # held, and standing
            lasting = min(lasting, now - self._now, self._seconds_to_switch(acceleration))
            before = self.pressed()
            self._go(acceleration, lasting)
            self._heed_switches(before)
        self._now = max(self._now, now)

    def _nominal(self, move: Move) -> float:
        override = 1.0 if move.fixed_feed else self.rapid_override if move.rapid else self.feed_override
        return min((move.limit if move.rapid else move.feed) * override, move.limit)

    def _phase(self) -> tuple[float, float]:
        """Acceleration of the move under way, mm/s^2, and how long it lasts unless something comes between."""
        move = self.queue[0]
        a, v, left = move.acceleration, self.speed, move.length - move.done
        nominal, end = self._nominal(move), move.exit
        if self.holding:
            return (-a, v / a) if v > 0.0 else (0.0, math.inf)
        if v > nominal + TINY:
            return -a, (v - nominal) / a
        if left <= TINY or (v > end and left <= (v * v - end * end) / (2.0 * a) + TINY):
            return (-a, max((v - end) / a, 0.0)) if v > end else (0.0, 0.0)
        if v < nominal - TINY:
            top = min(nominal, math.sqrt(a * left + (v * v + end * end) / 2.0))
            if top > v + TINY:
                return a, (top - v) / a
        return 0.0, (left - max(v * v - end * end, 0.0) / (2.0 * a)) / v

    def _go(self, acceleration: float, lasting: float) -> None:
        move = self.queue[0]
        free = [0.0 if locked else u for u, locked in zip(move.unit, self.locked, strict=True)]
        if self._noted != (id(move), acceleration):
            self._note(_times(free, self.speed), _times(free, acceleration), move.light)
            self._noted = (id(move), acceleration)
        distance = self.speed * lasting + acceleration * lasting**2 / 2.0
        self._rail = self._rail_after(free, distance)
        self._steps = _triple([at + distance * u for at, u in zip(self._steps, free, strict=True)])
        self._now += lasting
        move.done += distance
        speed = self.speed + acceleration * lasting
        self.speed = 0.0 if speed < TINY else speed
        if move.length - move.done <= 1e-7 and self.speed <= move.exit + 1e-6:
            self._finish(move)
        elif self.holding and self.speed == 0.0:
            self._note(NOTHING, NOTHING, LaserPower() if self.dark_when_held else move.light)

    def _rail_after(self, free: list[float], distance: float) -> Triple:
        moved = zip(self.rails, self._rail, free, strict=True)
        return _triple([rail.after(at, distance * u) for rail, at, u in moved])

    def _finish(self, move: Move) -> None:
        if not any(self.locked):
            self._steps = move.target
        self.queue.popleft()
        self.standing_light = LaserPower() if move.light.full_at else move.light
        if not self.queue:
            self.speed = 0.0
            self._note(NOTHING, NOTHING, self.standing_light)

    def _seconds_to_switch(self, acceleration: float) -> float:
        if self.watch == "none":
            return math.inf
        axes = zip(self.rails, self._rail, self.queue[0].unit, self.locked, strict=True)
        times = [
            rail.seconds_to_switch(at, self.speed * u, acceleration * u) for rail, at, u, locked in axes if not locked
        ]
        return min(times, default=math.inf)

    def _heed_switches(self, before: tuple[bool, bool, bool]) -> None:
        """Homing locks each axis whose switch is pressed; otherwise a switch that changes ends everything."""
        pressed = self.pressed()
        if self.watch == "homing":
            locked = [was or now for was, now in zip(self.locked, pressed, strict=True)]
            if locked != self.locked:
                self.locked = locked
                self._noted = None
            if all(locked):
                self.flush()
        elif self.watch == "limits" and pressed != before:
            self.tripped = True
            self.kill()

    def _note_again(self) -> None:
        """Something other than the motors has changed: a new piece begins, whatever is under way."""
        if self._noted is None:
            self._note(NOTHING, NOTHING, self.standing_light)
        self._noted = None

    def _note(self, velocity: Triple, acceleration: Triple, light: LaserPower) -> None:
        self._begins.append(self._now)
        stuck = (self.rails[0].stuck, self.rails[1].stuck, self.rails[2].stuck)
        self._pieces.append(Piece(self._steps, self._rail, velocity, acceleration, light, stuck))
        self._noted = None
        if len(self._begins) > 2 * KEPT:
            del self._begins[:KEPT], self._pieces[:KEPT]

    def _piece(self, when: float) -> tuple[float, Piece]:
        index = max(bisect_right(self._begins, when) - 1, 0)
        return self._begins[index], self._pieces[index]


def _moved(piece: Piece, lasting: float) -> list[float]:
    terms = zip(piece.velocity, piece.acceleration, strict=True)
    return [v * lasting + a * lasting * lasting / 2.0 for v, a in terms]


def _speed(piece: Piece, lasting: float) -> float:
    return math.hypot(*(v + a * lasting for v, a in zip(piece.velocity, piece.acceleration, strict=True)))


def _times(unit: list[float], by: float) -> Triple:
    return unit[0] * by, unit[1] * by, unit[2] * by


def _triple(values: list[float]) -> Triple:
    a, b, c = values
    return a, b, c
