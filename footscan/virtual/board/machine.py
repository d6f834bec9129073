"""The state of the virtual board, which G-code, `$` commands and reports read and change."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import Literal

from footscan.virtual.board.gcode import Modes
from footscan.virtual.board.memory import Build, Memory
from footscan.virtual.board.motion import Motion

State = Literal["Idle", "Run", "Hold", "Jog", "Alarm", "Door", "Home"]
Work = Generator[Callable[[], bool], None, int]
"""A line under way: yields what it waits for, returns the number of its error, 0 for `ok`."""


@dataclass
class Overrides:
    """Percent of what is programmed."""

    feed: int = 100
    rapid: int = 100
    light: int = 100


@dataclass
class Counters:
    """How many reports until these fields appear again."""

    offsets: int = 0
    overrides: int = 0


@dataclass
class Pins:
    """Inputs other than limit switches."""

    door_open: bool = False


@dataclass
class Machine(ABC):
    """State, and what can be done with it; `Firmware` does it."""

    motion: Motion
    memory: Memory
    build: Build
    say: Callable[[str], None]
    """Takes a line of answer, without its line end."""
    now: float = 0.0
    pins: Pins = field(default_factory=Pins)
    state: State = "Idle"
    modes: Modes = field(default_factory=Modes)
    where: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the heads stand when all that is queued is done, machine coordinates."""
    overrides: Overrides = field(default_factory=Overrides)
    counters: Counters = field(default_factory=Counters)
    critical: bool = False
    received: bytearray = field(default_factory=bytearray)
    second_switch_missing: bool = False
    """Whether the second motor of an axis with two never finds its switch."""

    @abstractmethod
    def alarm(self, number: int) -> None:
        """Stops everything. What happened is said; the two worst are followed by a reset of the host's."""

    @abstractmethod
    def answer_query(self) -> None:
        """Reports, where that was asked for since the last report."""

    @abstractmethod
    def restart(self, *, after_alarm: bool) -> None:
        """Begins anew with its motors' position kept, as after a reset; the line under way is answered with `ok`."""

    @abstractmethod
    def plan_has_room(self) -> bool:
        """Whether one more move can be queued."""

    @abstractmethod
    def is_still(self) -> bool:
        """Whether all that was queued is done."""

    @abstractmethod
    def begin(self, state: State) -> None:
        """A move was queued: the state it is made in, unless something moves already."""

    @property
    @abstractmethod
    def door_ajar(self) -> bool:
        """Whether the door's input is wired in and open."""

    @property
    @abstractmethod
    def substate(self) -> int | None:
        """The number behind Hold and Door."""
