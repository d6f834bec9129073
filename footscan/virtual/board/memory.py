"""What the virtual board keeps when its power is off: its settings."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from footscan.virtual.board.rails import Triple

FACTORY: Mapping[int, float] = {
    **{0: 10, 1: 25, 2: 0, 3: 0, 4: 0, 5: 0, 6: 0, 10: 1, 11: 0.010, 12: 0.002, 13: 0},
    **{20: 0, 21: 0, 22: 0, 23: 0, 24: 25.0, 25: 500.0, 26: 250, 27: 1.0, 30: 1000, 31: 0, 32: 0},
    **{100: 250.0, 101: 250.0, 102: 250.0, 110: 500.0, 111: 500.0, 112: 500.0},
    **{120: 10.0, 121: 10.0, 122: 10.0, 130: 200.0, 131: 200.0, 132: 200.0},
}
"""As the generic build of the firmware comes."""

SET_UP: Mapping[int, float] = {
    **FACTORY,
    **{1: 255, 10: 1, 20: 1, 21: 1, 22: 1, 24: 120.0, 25: 2400.0, 26: 50, 27: 2.0, 30: 1000, 32: 1},
    **{100: 80.0, 101: 80.0, 102: 80.0, 110: 6000.0, 111: 6000.0, 112: 6000.0},
    **{120: 500.0, 121: 500.0, 122: 500.0, 130: 430.0, 131: 430.0, 132: 430.0},
}
"""As a scanner's board is set up: belts at 80 steps a mm, rails of 430 mm, a laser on the spindle's output."""

WHOLE = {0, 1, 2, 3, 4, 5, 6, 10, 13, 20, 21, 22, 23, 26, 30, 31, 32}
"""Settings that are printed without decimals."""


@dataclass(frozen=True)
class Build:
    """What was chosen when the firmware was compiled."""

    version: str = "1.1h"
    built: str = "20190830"
    variable_spindle: bool = True
    door_pin: bool = True
    line_length: int = 80
    homing_cycles: tuple[tuple[int, ...], ...] = ((2,), (0, 1))
    """Axes that are homed together, one cycle after the other."""
    second_motor: bool = False
    """Whether an axis has two motors, each with a switch of its own."""

    @property
    def options(self) -> str:
        """The letters of `[OPT:...]`."""
        return ("V" if self.variable_spindle else "") + ("2" if self.second_motor else "") + "+" * self.door_pin


@dataclass
class Memory:
    """The EEPROM."""

    settings: dict[int, float] = field(default_factory=lambda: dict(SET_UP))

    def __getitem__(self, number: int) -> float:
        return self.settings[number]

    def axes(self, first: int) -> Triple:
        """Three settings that stand for the three axes."""
        return self.settings[first], self.settings[first + 1], self.settings[first + 2]

    def flag(self, number: int) -> bool:
        """A setting that is on or off."""
        return bool(self.settings[number])

    def store(self, number: int, value: float, build: Build) -> int:
        """Writes a setting; the error's number, 0 where it is taken."""
        whole = int(value) % 256
        mistakes = (
            (4, value < 0),
            (3, number not in self.settings),
            (6, number == 0 and whole < 3),
            (10, number == 20 and whole and not self.flag(22)),
            (17, number == 32 and not build.variable_spindle),
        )
        error = next((error for error, made in mistakes if made), 0)
        if not error:
            self._write(number, value, whole)
        return error

    def printed(self) -> list[str]:
        """The lines of `$$`."""
        return [f"${n}={v:.0f}" if n in WHOLE else f"${n}={v:.3f}" for n, v in sorted(self.settings.items())]

    def _write(self, number: int, value: float, whole: int) -> None:
        if number in (4, 5, 6, 13, 20, 21, 22, 32):
            self.settings[number] = int(whole != 0)
        else:
            self.settings[number] = whole if number in WHOLE - {30, 31} else value
        if number == 22 and not whole:
            self.settings[20] = 0  # soft limits mean nothing without a home
