"""The settings that a scanner's board must have, and whether it has them."""

from collections.abc import Mapping
from dataclasses import dataclass

from footscan.capture.grbl.codes import SETTINGS
from schemas.base.errors import RefusedInput

Triple = tuple[float, float, float]

SAME = 1e-3
"""The board prints three decimals."""
ROUNDED = (30, 31)
"""Printed without decimals."""


@dataclass(frozen=True)
class BoardSettings:
    """What the scanner's mechanics ask of the board; one value for each of the heads 1, 2, 3 (axes X, Y, Z)."""

    steps_per_mm: Triple = (80.0, 80.0, 80.0)
    """Belt with 2 mm teeth, pulley with 20, 1/16 steps of 1.8 degrees: 3200 / 40."""
    max_mm_per_s: Triple = (100.0, 100.0, 100.0)
    """Fastest speed of each head; 36.4 mm/s take 40 cm in 11 s."""
    mm_per_s2: Triple = (500.0, 500.0, 500.0)
    travel_mm: Triple = (430.0, 430.0, 430.0)
    """How far a head may go from its home switch: less than the distance of the two switches."""
    homing_mm_per_s: float = 40.0
    homing_slow_mm_per_s: float = 2.0
    pull_off_mm: float = 2.0
    """How far a head stands from its home switch after homing."""
    full_power: float = 1000.0
    """S at which the laser is at full power."""

    def wanted(self) -> dict[int, float]:
        """Every setting that matters, by its number.

        Motors stay on ($1=255): a head must not creep between homing and film. Laser mode ($32=1) makes light depend on
        motion; soft limits ($20), hard limits ($21) and homing ($22) keep the heads on their rails.
        """
        heads = range(3)
        return {
            **{1: 255, 10: 1, 13: 0, 20: 1, 21: 1, 22: 1},
            **{24: self.homing_slow_mm_per_s * 60.0, 25: self.homing_mm_per_s * 60.0, 27: self.pull_off_mm},
            **{30: self.full_power, 31: 0, 32: 1},
            **{100 + head: self.steps_per_mm[head] for head in heads},
            **{110 + head: self.max_mm_per_s[head] * 60.0 for head in heads},
            **{120 + head: self.mm_per_s2[head] for head in heads},
            **{130 + head: self.travel_mm[head] for head in heads},
        }

    def lines(self) -> list[str]:
        """What to send to a board to set it up, in an order that it takes: homing before soft limits."""
        wanted = self.wanted()
        order = [22, *(number for number in wanted if number != 22)]
        return [setting_line(number, wanted[number]) for number in order]

    def check(self, found: Mapping[int, float], source: str) -> None:
        """Refuses a board that is set up in another way.

        Parameters
        ----------
        found : the board's settings, by number.
        source : what the board is called in the message.

        Raises
        ------
        RefusedInput
            The first setting that is wrong or missing, what it is, what is expected and the line to send.
        """
        for number, value in self.wanted().items():
            is_there = found.get(number)
            if is_there is None or abs(is_there - value) > SAME:
                state = "is missing" if is_there is None else f"is {is_there:g}"
                raise RefusedInput(
                    source,
                    f"{state}, expected {value:g}: send {setting_line(number, value)}",
                    field=f"${number} ({SETTINGS[number]})",
                )


def setting_line(number: int, value: float) -> str:
    """The line that writes a setting."""
    return f"${number}={value:.3f}".rstrip("0").rstrip(".")
