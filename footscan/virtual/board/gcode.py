"""G-code as the virtual board reads it: a line becomes a `Block`, or the number of the error in it.

The checks, and the order in which the first mistake is found, are those of the firmware's documentation.
"""

import math
import re
from dataclasses import dataclass, field, replace

from footscan.virtual.board.memory import Memory
from footscan.virtual.board.rails import Triple

AXES = "XYZ"
OFFSETS = "IJK"
MM_PER_INCH = 25.4
WORD = re.compile(r"([A-Z])([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))?")
MODAL_GROUPS = {
    **dict.fromkeys(("G4", "G10", "G28", "G28.1", "G30", "G30.1", "G53", "G92", "G92.1"), "action"),
    **dict.fromkeys(("G0", "G1", "G2", "G3", "G38.2", "G38.3", "G38.4", "G38.5", "G80"), "motion"),
    **dict.fromkeys(("G17", "G18", "G19"), "plane"),
    **dict.fromkeys(("G90", "G91"), "distance"),
    "G91.1": "arc distance",
    **dict.fromkeys(("G93", "G94"), "feed mode"),
    **dict.fromkeys(("G20", "G21"), "units"),
    "G40": "cutter radius",
    **dict.fromkeys(("G43.1", "G49"), "tool length"),
    **dict.fromkeys(("G54", "G55", "G56", "G57", "G58", "G59"), "system"),
    "G61": "path",
    **dict.fromkeys(("M0", "M1", "M2", "M30"), "flow"),
    **dict.fromkeys(("M3", "M4", "M5"), "spindle"),
    **dict.fromkeys(("M8", "M9"), "coolant"),
}
FRACTIONS = {28, 30, 38, 43, 90, 91, 92, 61}
"""Numbers of G commands some of which have a fraction; a wrong one there is unsupported (20), elsewhere error 23."""
USES_AXES = {"G10", "G28", "G30", "G92"}
MOVES = {"G0", "G1", "G2", "G3", "G38.2", "G38.3", "G38.4", "G38.5"}
LARGEST = {"N": 10_000_000.0, "T": 255.0}
IN_PLANE = {"G17": (0, 1), "G18": (2, 0), "G19": (1, 2)}
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
    system: str = "G54"
    plane: str = "G17"
    units: str = "G21"
    distance: str = "G90"
    feed_mode: str = "G94"
    spindle: str = "M5"
    coolant: str = "M9"
    tool: int = 0
    feed: float = 0.0
    """mm/min; under G93 moves a minute."""
    power: float = 0.0
    """The S word."""


@dataclass(frozen=True)
class Offsets:
    """Between machine and work coordinates, mm."""

    system: Triple = (0.0, 0.0, 0.0)
    shifted: Triple = (0.0, 0.0, 0.0)
    """By G92."""
    tool: float = 0.0

    @property
    def total(self) -> Triple:
        """Machine position minus work position."""
        a, b, c = (s + o for s, o in zip(self.system, self.shifted, strict=True))
        return a, b, c + self.tool


@dataclass(frozen=True)
class Block:
    """One line, understood."""

    modes: Modes
    action: str = ""
    """A command of its own: G4, G10, G28, G28.1, G30, G30.1, G92, G92.1; empty where there is none."""
    moves: bool = False
    target: Triple = (0.0, 0.0, 0.0)
    """Machine coordinates, mm; for G10 and G92 what they store."""
    dwell: float = 0.0
    stored_system: str = ""
    tool_length: float | None = None
    flow: str = ""


@dataclass
class _Line:
    commands: dict[str, str] = field(default_factory=dict)
    """By modal group."""
    values: dict[str, float] = field(default_factory=dict)
    uses_axes: bool = False
    """Whether one of the commands says what the words X, Y, Z are for."""

    @property
    def axes(self) -> str:
        return "".join(letter for letter in AXES if letter in self.values)


def read_block(line: str, modes: Modes, where: Triple, offsets: Offsets, memory: Memory, *, jog: bool = False) -> Block:
    """`line`, upper case and without spaces, read after the `modes` before it, at the end of all moves queued.

    Raises
    ------
    GcodeError
        With the number of the first mistake, from 1 to 38.
    """
    words = _words(line)
    before = replace(modes, motion="G1", feed_mode="G94") if jog else modes
    after = _new_modes(before, words, jog=jog)
    action = words.commands.get("action", "")
    scale = MM_PER_INCH if after.units == "G20" else 1.0
    if action == "G4":
        _needs(words, "P")
    tool_length = _tool_length(words, scale)
    system_offsets = _system_offsets(modes, after, offsets, memory)
    stored, target = _destination(words, after, where, system_offsets, memory, scale)
    moves, used = _motion(words, after, where, target, scale)
    used |= set("NF") if jog else set("NFST")
    used |= {"G4": set("P"), "G10": set("LP")}.get(action, set())
    if set(words.values) - used:
        raise GcodeError(36)
    if jog and (set(words.commands) - JOG_GROUPS or action not in ("", "G53")):
        raise GcodeError(16)
    return Block(
        modes=after,
        action=action,
        moves=moves,
        target=target,
        dwell=words.values.get("P", 0.0),
        stored_system=stored,
        tool_length=tool_length,
        flow=words.commands.get("flow", ""),
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
    if name in USES_AXES or name in MOVES or group == "tool length":
        if found.uses_axes:
            raise GcodeError(24)
        found.uses_axes = True
    if group in found.commands:
        raise GcodeError(21)
    found.commands[group] = name


def _value(found: _Line, letter: str, number: float) -> None:
    if letter not in "FIJKLNPRSTXYZ":
        raise GcodeError(20)
    if letter == "T" and number > LARGEST["T"]:
        raise GcodeError(38)
    if letter in found.values:
        raise GcodeError(25)
    if letter in "FNPST" and number < 0:
        raise GcodeError(4)
    found.values[letter] = number


def _new_modes(modes: Modes, words: _Line, *, jog: bool) -> Modes:
    if words.values.get("N", 0.0) > LARGEST["N"]:
        raise GcodeError(27)
    commands = words.commands
    after = replace(
        modes,
        motion=commands.get("motion", modes.motion),
        system=commands.get("system", modes.system),
        plane=commands.get("plane", modes.plane),
        units=commands.get("units", modes.units),
        distance=commands.get("distance", modes.distance),
        feed_mode=commands.get("feed mode", modes.feed_mode),
        spindle=commands.get("spindle", modes.spindle),
        coolant=commands.get("coolant", modes.coolant),
        tool=int(words.values.get("T", modes.tool)),
        power=words.values.get("S", modes.power),
    )
    scale = MM_PER_INCH if after.units == "G20" and after.feed_mode == "G94" else 1.0
    feed = words.values["F"] * scale if "F" in words.values else None
    if jog and feed is None:
        raise GcodeError(22)
    if after.feed_mode == "G93" or modes.feed_mode == "G93":
        feed = feed or 0.0  # holds for its line alone
    return after if feed is None else replace(after, feed=feed)


def _needs(words: _Line, letters: str) -> None:
    if not set(letters) <= set(words.values):
        raise GcodeError(28)


def _tool_length(words: _Line, scale: float) -> float | None:
    command = words.commands.get("tool length")
    if command == "G43.1":
        if words.axes != "Z":
            raise GcodeError(37)
        return words.values["Z"] * scale
    return 0.0 if command == "G49" else None


def _system_offsets(modes: Modes, after: Modes, offsets: Offsets, memory: Memory) -> Offsets:
    """The offsets in force when a line may have chosen another coordinate system."""
    if after.system == modes.system:
        return offsets
    return replace(offsets, system=_recall(memory, after.system))


def _recall(memory: Memory, name: str) -> Triple:
    content = memory.recall(name)
    if content is None:
        raise GcodeError(7)
    return content


def _destination(
    words: _Line, modes: Modes, where: Triple, offsets: Offsets, memory: Memory, scale: float
) -> tuple[str, Triple]:
    """The coordinate system that is stored, if one is, and the target: of the motion, or of what is stored."""
    action = words.commands.get("action", "")
    if action in ("G10", "G92") and not words.axes:
        raise GcodeError(26)
    if action == "G10":
        return _coordinate_data(words, where, offsets, memory, modes.system, scale)
    if action == "G92":
        return "", _shift(words, where, offsets, scale)
    if action in ("G28", "G30"):
        _recall(memory, action)
    if action == "G53" and modes.motion not in ("G0", "G1"):
        raise GcodeError(30)
    return "", _target(words, where, offsets, scale, incremental=modes.distance == "G91", machine=action == "G53")


def _motion(words: _Line, modes: Modes, where: Triple, target: Triple, scale: float) -> tuple[bool, set[str]]:
    """Whether heads move by the motion mode in force, and the words that are used up by motions and actions."""
    axes = words.axes
    explicit = words.commands.get("motion", "") in MOVES
    elsewhere = words.commands.get("action", "") in USES_AXES or "tool length" in words.commands
    if modes.motion == "G80":
        if axes:
            raise GcodeError(31)
        return False, set()
    if not explicit and (elsewhere or not axes):
        return False, set(AXES)
    used = _check_motion(words, modes, where, target, scale)
    return bool(axes), used | set(AXES)


def _coordinate_data(
    words: _Line, where: Triple, offsets: Offsets, memory: Memory, active: str, scale: float
) -> tuple[str, Triple]:
    _needs(words, "PL")
    number = int(words.values["P"])
    if number > 6:
        raise GcodeError(29)
    kind = int(words.values["L"])
    if kind not in (2, 20) or "R" in words.values:
        raise GcodeError(20)
    name = f"G{53 + number}" if number else active
    old = _recall(memory, name)
    here = zip(where, offsets.shifted, (0.0, 0.0, offsets.tool), strict=True)
    base = [at - shifted - tool if kind == 20 else 0.0 for at, shifted, tool in here]
    sign = -1.0 if kind == 20 else 1.0
    given = [words.values.get(axis) for axis in AXES]
    values = [kept if g is None else b + sign * g * scale for kept, g, b in zip(old, given, base, strict=True)]
    return name, (values[0], values[1], values[2])


def _shift(words: _Line, where: Triple, offsets: Offsets, scale: float) -> Triple:
    given = [words.values.get(axis) for axis in AXES]
    terms = zip(given, where, offsets.system, (0.0, 0.0, offsets.tool), offsets.shifted, strict=True)
    values = [old if g is None else at - system - tool - g * scale for g, at, system, tool, old in terms]
    return values[0], values[1], values[2]


def _target(words: _Line, where: Triple, offsets: Offsets, scale: float, *, incremental: bool, machine: bool) -> Triple:
    given = [words.values.get(axis) for axis in AXES]
    values = [
        at if g is None else g * scale + (0.0 if machine else at if incremental else offset)
        for g, at, offset in zip(given, where, offsets.total, strict=True)
    ]
    return values[0], values[1], values[2]


def _check_motion(words: _Line, modes: Modes, where: Triple, target: Triple, scale: float) -> set[str]:
    """The words that the motion uses besides those of the axes."""
    if modes.motion == "G0":
        return set()
    if modes.feed == 0.0:
        raise GcodeError(22)
    if modes.motion == "G1":
        return set()
    if not words.axes:
        raise GcodeError(26)
    if modes.motion in ("G2", "G3"):
        return _check_arc(words, modes, where, target, scale)
    if target == where:
        raise GcodeError(33)
    return set()


def _check_arc(words: _Line, modes: Modes, where: Triple, target: Triple, scale: float) -> set[str]:
    first, second = IN_PLANE[modes.plane]
    if not {AXES[first], AXES[second]} & set(words.axes):
        raise GcodeError(32)
    x, y = target[first] - where[first], target[second] - where[second]
    if "R" in words.values:
        if target == where:
            raise GcodeError(33)
        if 4.0 * (words.values["R"] * scale) ** 2 < x * x + y * y:
            raise GcodeError(34)
        return {"R"}
    if not {OFFSETS[first], OFFSETS[second]} & set(words.values):
        raise GcodeError(35)
    i, j = (words.values.get(OFFSETS[k], 0.0) * scale for k in (first, second))
    radius, apart = math.hypot(i, j), abs(math.hypot(x - i, y - j) - math.hypot(i, j))
    if apart > 0.5 or apart > max(0.005, 0.001 * radius):
        raise GcodeError(33)
    return set(OFFSETS)
