"""States of the board, in words for its user."""

from dataclasses import dataclass
from typing import Literal

from footscan.capture.grbl.codes import alarm_in_words
from footscan.capture.grbl.report import Report

StateName = Literal[
    "ready",
    "not homed",
    "moving",
    "jogging",
    "homing",
    "held",
    "door",
    "alarm",
    "restarting",
    "lost",
    "closed",
    "other",
]

HOME = "home the heads"


@dataclass(frozen=True)
class BoardState:
    """A state of the board."""

    name: StateName
    words: str
    """Description and cause."""
    remedy: str = ""
    """What the user can do; empty if nothing is needed."""

    def __str__(self) -> str:
        return f"{self.words}; {self.remedy}" if self.remedy else self.words


def state_from(report: Report, *, homed: bool, alarm: int | None) -> BoardState:
    """Return the state of a status report; `alarm` is the number of the latest alarm since homing."""
    other = BoardState("other", f"the board is in its state {report.state}", "reset it")
    lost = _not_homed(alarm)
    return {
        "Idle": BoardState("ready", "the heads stand") if homed else lost,
        "Run": BoardState("moving", "the heads travel"),
        "Jog": BoardState("jogging", "the heads are moved by hand"),
        "Home": BoardState("homing", "the heads look for their home switches"),
        "Hold": _held(report.substate),
        "Door": _door(report.substate),
        "Alarm": lost if alarm is None else BoardState("alarm", alarm_in_words(alarm)),
    }.get(report.state, other)


def _not_homed(alarm: int | None) -> BoardState:
    why = "" if alarm is None else f" ({alarm_in_words(alarm)})"
    return BoardState("not homed", f"where the heads stand is not known{why}", HOME)


def _held(substate: int | None) -> BoardState:
    if substate == 0:
        return BoardState("held", "the heads are held, the lasers are off", "resume or stop")
    return BoardState("held", "the heads come to a halt", "wait until they stand")


def _door(substate: int | None) -> BoardState:
    match substate:
        case 0:
            return BoardState("door", "the lid or door was open and is closed again", "resume or stop")
        case 3:
            return BoardState("door", "the lid or door is closed, the travel goes on")
        case _:
            return BoardState("door", "the lid or door is open: heads and lasers are stopped", "close it, then resume")
