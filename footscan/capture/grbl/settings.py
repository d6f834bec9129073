"""The settings that the board of a scanner must have, and the check of a board."""

from collections.abc import Mapping

from footscan.capture.grbl.codes import SETTINGS
from schemas.base.errors import RefusedInput
from schemas.rig import RigBoard

SAME = 1e-3
"""The board prints three decimals."""
ROUNDED = (30, 31)
"""Printed without decimals."""


def required_settings(setup: RigBoard) -> dict[int, float]:
    """Return every setting that matters, by its number.

    Motors stay on ($1=255): a head must not creep between homing and film. Laser mode ($32=1) makes light depend on
    motion; soft limits ($20), hard limits ($21) and homing ($22) keep the heads on their rails.
    """
    return {
        **{1: 255, 10: 1, 13: 0, 20: 1, 21: 1, 22: 1},
        **{24: setup.homing_slow_mm_per_s * 60.0, 25: setup.homing_mm_per_s * 60.0, 27: setup.pull_off_mm},
        **{30: setup.full_power, 31: 0, 32: 1},
        **dict(enumerate(setup.steps_per_mm, start=100)),
        **{number: speed * 60.0 for number, speed in enumerate(setup.max_mm_per_s, start=110)},
        **dict(enumerate(setup.mm_per_s2, start=120)),
        **dict(enumerate(setup.travel_mm, start=130)),
    }


def setup_lines(setup: RigBoard) -> list[str]:
    """Return the lines that set up a board, in an order that it accepts: homing before soft limits."""
    required = required_settings(setup)
    order = [22, *(number for number in required if number != 22)]
    return [setting_line(number, required[number]) for number in order]


def check_settings(found: Mapping[int, float], setup: RigBoard, source: str) -> None:
    """Refuse a board with other settings than those of the rig.

    Parameters
    ----------
    found : the settings of the board, by number.
    source : name of the board in the message.

    Raises
    ------
    RefusedInput
        The first setting that is wrong or missing, its value, the expected one and the line to send.
    """
    for number, value in required_settings(setup).items():
        present = found.get(number)
        if present is None or abs(present - value) > SAME:
            state = "is missing" if present is None else f"is {present:g}"
            raise RefusedInput(
                source,
                f"{state}, expected {value:g}: send {setting_line(number, value)}",
                field=f"${number} ({SETTINGS[number]})",
            )


def setting_line(number: int, value: float) -> str:
    """Return the line that writes a setting."""
    return f"${number}={value:.3f}".rstrip("0").rstrip(".")
