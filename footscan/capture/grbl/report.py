"""What Grbl 1.1 says, line by line: answers, alarms, settings, messages and status reports."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field

Triple = tuple[float, float, float]

STATES = ("Idle", "Run", "Hold", "Jog", "Alarm", "Door", "Check", "Home", "Sleep")
NUMBER = r"-?[0-9]+(?:\.[0-9]+)?"
LENGTH = r"-?[0-9]+\.[0-9]{3,4}"
"""Three decimals in mm, four in inches: one that lost a byte is told by that."""
TRIPLE = rf"({LENGTH}),({LENGTH}),({LENGTH})"


@dataclass(frozen=True)
class Answer:
    """`ok` (0) or `error:N`: every line that was sent gets one, in the order of the lines."""

    error: int


@dataclass(frozen=True)
class Alarm:
    """`ALARM:N`: everything was stopped."""

    number: int


@dataclass(frozen=True)
class Welcome:
    """`Grbl 1.1h ['$' for help]`: the board has just restarted."""

    version: str


@dataclass(frozen=True)
class Setting:
    """`$N=value`."""

    number: int
    value: float


@dataclass(frozen=True)
class Feedback:
    """`[KIND:text]`."""

    kind: str
    text: str


@dataclass(frozen=True)
class StartUpLine:
    """`>line:ok` or `>line:error:N`, and `$Nx=line`: stored G-code, executed or listed."""

    text: str


@dataclass(frozen=True)
class Report:
    """`<Idle|MPos:...>`: where the heads are and what the board does."""

    state: str
    substate: int | None
    machine_mm: Triple | None
    """Machine position, mm as the firmware counts steps; None in a report of work positions whose offset is unknown."""
    work_mm: Triple | None = None
    rate: float = 0.0
    """Speed through the space of the three axes, mm/min."""
    power: float = 0.0
    """S as it is put out now."""
    pins: str = ""
    """Inputs that are active: X, Y, Z (end switches of heads 1, 2, 3), P, D (lid or door), H, R, S."""
    free: tuple[int, int] | None = None
    """Moves that can still be planned, bytes that can still be received."""
    overrides: tuple[int, int, int] | None = None
    """Percent of feed, rapids and power, where told."""
    offset_mm: Triple | None = None
    """Machine minus work position, where told."""
    lit: str = ""
    """S where M3 is in force, C where M4 is; only in reports that tell overrides."""


@dataclass(frozen=True)
class Garbled:
    """A line that is none of these."""

    text: str = field(repr=True)


Message = Answer | Alarm | Welcome | Setting | Feedback | StartUpLine | Report | Garbled


def read_line(text: str) -> Message | None:
    """The meaning of a line without its line end; None for an empty one, `Garbled` for what is none of Grbl's."""
    if not text:
        return None
    for form, made in FORMS:
        match = form.fullmatch(text)
        if match:
            return made(match) or Garbled(text)
    return Garbled(text)


def _report(text: str) -> Report | None:
    """A status report; None where any part of it is damaged."""
    head, *parts = text[1:-1].split("|")
    match = re.fullmatch(r"([A-Z][a-z]+)(?::([0-9]))?", head)
    if match is None or match[1] not in STATES:
        return None
    fields: dict[str, str] = {}
    for part in parts:
        name, colon, value = part.partition(":")
        if not colon or name in fields:
            return None
        fields[name] = value
    machine, work, offset = (_triple(fields.get(name)) for name in ("MPos", "WPos", "WCO"))
    speeds = re.fullmatch(rf"({NUMBER}),({NUMBER})", fields.get("FS", f"{fields.get('F')},0"))
    free, overrides = _whole(fields.get("Bf")), _whole(fields.get("Ov"))
    known = re.fullmatch(r"[XYZPDHRSA]*", fields.get("Pn", "")) and re.fullmatch(r"[SCFM]*", fields.get("A", ""))
    counted = [fields.get(name) is not None for name in ("MPos", "WPos", "WCO")] == [
        value is not None for value in (machine, work, offset)
    ]
    if (
        not (known and counted and speeds and (machine or work))
        or len(free) not in (0, 2)
        or len(overrides) not in (0, 3)
    ):
        return None
    if machine is None and work is not None and offset is not None:
        machine = (work[0] + offset[0], work[1] + offset[1], work[2] + offset[2])
    return Report(
        state=match[1],
        substate=int(match[2]) if match[2] else None,
        machine_mm=machine,
        work_mm=work,
        rate=float(speeds[1]),
        power=float(speeds[2]),
        pins=fields.get("Pn", ""),
        free=(free[0], free[1]) if free else None,
        overrides=(overrides[0], overrides[1], overrides[2]) if overrides else None,
        offset_mm=offset,
        lit=fields.get("A", ""),
    )


def _triple(value: str | None) -> Triple | None:
    match = re.fullmatch(TRIPLE, value) if value is not None else None
    return (float(match[1]), float(match[2]), float(match[3])) if match else None


def _whole(value: str | None) -> list[int]:
    """Whole numbers between commas; a list of one that fits nowhere where there is something else."""
    if value is None:
        return []
    return [int(n) for n in value.split(",")] if re.fullmatch(r"[0-9]+(,[0-9]+)*", value) else [0]


FORMS: tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], Message | None]], ...] = (
    (re.compile(r"ok"), lambda _: Answer(0)),
    (re.compile(r"error:([0-9]{1,3})"), lambda match: Answer(int(match[1]))),
    (re.compile(r"ALARM:([0-9]{1,3})"), lambda match: Alarm(int(match[1]))),
    (re.compile(r"Grbl(?:HAL)? ([0-9]\.[0-9][a-z]?)[^\[]* \['\$'.* for help\]"), lambda match: Welcome(match[1])),
    (re.compile(rf"\$([0-9]{{1,3}})=({NUMBER})"), lambda match: Setting(int(match[1]), float(match[2]))),
    (re.compile(r"\[([A-Z0-9]+|echo):(.*)\]"), lambda match: Feedback(match[1], match[2])),
    (re.compile(r">.*:(ok|error:[0-9]+)|\$N[0-9]=.*"), lambda match: StartUpLine(match[0])),
    (re.compile(r"<.*>"), lambda match: _report(match[0])),
)
"""Every kind of line, and what it means; None where its inside is damaged."""
