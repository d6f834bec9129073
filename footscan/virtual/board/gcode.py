"""G-code as the virtual board reads it: a line becomes a `Block`, or the number of the error in it.

It reads what a scanner's host sends: G0, G1, G4, G21, G53, G90, G91, G94, M3, M4 and M5. All else is error 20, as on a
board that does not support it. The checks, and the order in which the first mistake is found, are those of the
firmware's documentation.
"""

import re
from dataclasses import dataclass, field, replace

from footscan.virtual.board.rails import Triple

AXES = "XYZ"
WORD = re.compile(r"([A-Z])([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))?")
MODAL_GROUPS = {
    **dict.fromkeys(("G4", "G53"), "action"),
    **dict.fromkeys(("G0", "G1"), "motion"),
    **dict.fromkeys(("G90", "G91"), "distance"),
    "G94": "feed mode",
    "G21": "units",
    **dict.fromkeys(("M3", "M4", "M5"), "spindle"),
}
FRACTIONS = {90, 91}
"""Numbers of G commands some of which have a fraction; a wrong one there is unsupported (20), elsewhere error 23."""
JOG_GROUPS = {"distance", "units", "action"}


class GcodeError(Exception):
    """A line the board does not take; `number` is what it answers."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


@dataclass(frozen=True)
class Modes:
    """What holds from one line to the next."""

    motion: str = "G0"
    distance: str = "G90"
    spindle: str = "M5"
    feed: float = 0.0
    """mm/min."""
    power: float = 0.0
    """The S word."""


@dataclass(frozen=True)
class Block:
    """One line, understood."""

    modes: Modes
    moves: bool
    target: Triple
    """Machine coordinates, mm."""
    dwell: float | None
    """Seconds of G4; None in a line without it."""


@dataclass
class _Line:
    commands: dict[str, str] = field(default_factory=dict)
    """By modal group."""
    values: dict[str, float] = field(default_factory=dict)

    @property
    def has_axes(self) -> bool:
        return any(letter in self.values for letter in AXES)


def read_block(line: str, modes: Modes, where: Triple, *, jog: bool = False) -> Block:
    """`line`, upper case and without spaces, read after the `modes` before it, at the end of all moves queued.

    Raises
    ------
    GcodeError
        With the number of the first mistake, from 1 to 36.
    """
    words = _words(line)
    after = _new_modes(replace(modes, motion="G1") if jog else modes, words, jog=jog)
    action = words.commands.get("action", "")
    if action == "G4" and "P" not in words.values:
        raise GcodeError(28)
    if after.motion == "G1" and after.feed == 0.0 and (words.has_axes or "motion" in words.commands):
        raise GcodeError(22)
    used = {*AXES, "F"} | (set() if jog else {"S"}) | ({"P"} if action == "G4" else set())
    if set(words.values) - used:
        raise GcodeError(36)
    if jog and (set(words.commands) - JOG_GROUPS or action == "G4"):
        raise GcodeError(16)
    return Block(
        modes=after,
        moves=words.has_axes,
        target=_target(words, where, incremental=after.distance == "G91" and action != "G53"),
        dwell=words.values["P"] if action == "G4" else None,
    )


def _words(line: str) -> _Line:
    found, at = _Line(), 0
    while at < len(line):
        match = WORD.match(line, at)
        if match is None:
            raise GcodeError(1)
        letter, number = match.groups()
        if number is None:
            raise GcodeError(2)
        at = match.end()
        if letter in "GM":
            _command(found, letter, float(number))
        else:
            _value(found, letter, float(number))
    return found


def _command(found: _Line, letter: str, number: float) -> None:
    whole = int(number)
    name = f"{letter}{number:g}"
    if name not in MODAL_GROUPS:
        broken = number != whole and (letter == "M" or (whole not in FRACTIONS and f"G{whole}" in MODAL_GROUPS))
        raise GcodeError(23 if broken else 20)
    group = MODAL_GROUPS[name]
    if group in found.commands:
        raise GcodeError(24 if group == "motion" else 21)  # two that both use the axes, or two of another kind
    found.commands[group] = name


def _value(found: _Line, letter: str, number: float) -> None:
    if letter not in "FPSXYZ":
        raise GcodeError(20)
    if letter in found.values:
        raise GcodeError(25)
    if letter in "FPS" and number < 0:
        raise GcodeError(4)
    found.values[letter] = number


def _new_modes(modes: Modes, words: _Line, *, jog: bool) -> Modes:
    if jog and "F" not in words.values:
        raise GcodeError(22)
    commands = words.commands
    return Modes(
        motion=commands.get("motion", modes.motion),
        distance=commands.get("distance", modes.distance),
        spindle=commands.get("spindle", modes.spindle),
        feed=words.values.get("F", modes.feed),
        power=words.values.get("S", modes.power),
    )


def _target(words: _Line, where: Triple, *, incremental: bool) -> Triple:
    given = [words.values.get(axis) for axis in AXES]
    values = [at if g is None else g + at * incremental for g, at in zip(given, where, strict=True)]
    return values[0], values[1], values[2]
