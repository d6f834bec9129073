"""The virtual board's `$` commands."""

from __future__ import annotations

import re

from footscan.virtual.board.execute import execute_gcode, home, jog
from footscan.virtual.board.machine import Machine, Work
from footscan.virtual.board.memory import FACTORY, SYSTEMS
from footscan.virtual.board.report import HELP, build_report, modes_report, parameters_report

NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)")


def execute_system(board: Machine, line: str) -> Work:
    """One `$` command; the number of its error, 0 for `ok`."""
    command = line[1:2]
    if command == "J":
        return (yield from _jog(board, line))
    if command in "$GCX":
        return _at_any_time(board, line)
    if board.state not in ("Idle", "Alarm"):
        return 8
    if command == "H":
        return (yield from _home(board, line))
    if command == "N" and len(line) > 2:
        return (yield from _store_start_up(board, line))
    return _when_still(board, line)


def _jog(board: Machine, line: str) -> Work:
    if board.state not in ("Idle", "Jog"):
        return 8
    if line[2:3] != "=":
        return 3  # the documentation says 16, the firmware 3
    return (yield from jog(board, line[3:]))


def _at_any_time(board: Machine, line: str) -> int:
    match line:
        case "$":
            lines = [HELP]
        case "$$" if board.state in ("Run", "Hold"):
            return 8
        case "$$":
            lines = board.memory.printed()
        case "$G":
            lines = [modes_report(board)]
        case "$C":
            return _check_mode(board)
        case "$X":
            return _unlock(board)
        case _:
            return 3
    return _say_all(board, lines)


def _check_mode(board: Machine) -> int:
    if board.state == "Check":
        board.say("[MSG:Disabled]")
        board.state = "Idle"
        board.restart(after_alarm=False)
    elif board.state == "Idle":
        board.state = "Check"
        board.say("[MSG:Enabled]")
    else:
        return 8
    return 0


def _unlock(board: Machine) -> int:
    if board.state == "Alarm":
        if board.door_ajar:
            return 13
        board.say("[MSG:Caution: Unlocked]")
        board.state = "Idle"
    return 0


def _home(board: Machine, line: str) -> Work:
    if not board.memory.flag(22):
        return 5
    if board.door_ajar:
        return 13
    if line != "$H":
        return 3
    return (yield from home(board))


def _when_still(board: Machine, line: str) -> int:
    match line:
        case "$#":
            return _say_all(board, parameters_report(board))
        case "$I":
            if "name" in board.memory.damaged:
                board.memory.damaged.discard("name")
                board.memory.name = ""
                board.say("error:7")
            return _say_all(board, build_report(board))
        case "$N":
            return _say_all(board, [f"$N{number}={text}" for number, text in enumerate(board.memory.start_up)])
        case "$SLP":
            board.state = "Sleep"
            board.motion.flush()
            board.say("[MSG:Sleeping]")
            return 0
        case "$RST=$" | "$RST=#" | "$RST=*":
            return _restore(board, line[-1])
        case _:
            return _name(board, line[3:]) if line.startswith("$I=") else _store(board, line)


def _say_all(board: Machine, lines: list[str] | None) -> int:
    for line in lines or []:
        board.say(line)
    return 7 if lines is None else 0


def _name(board: Machine, name: str) -> int:
    if len(name) > board.build.stored_line_length:
        return 14
    board.memory.name = name
    return 0


def _restore(board: Machine, what: str) -> int:
    if what in "$*":
        board.memory.settings = dict(FACTORY)
    if what in "#*":
        board.memory.systems = dict.fromkeys(SYSTEMS, (0.0, 0.0, 0.0))
    if what == "*":
        board.memory.start_up = ["", ""]
        board.memory.name = ""
    board.say("[MSG:Restoring defaults]")
    board.restart(after_alarm=False)
    return 0


def _store(board: Machine, line: str) -> int:
    """`$x=val`."""
    number, rest, error = _assignment(line[1:])
    if error:
        return error
    value = NUMBER.match(rest)
    if value is None:
        return 2
    if value.end() != len(rest) or not 0 <= number <= 255:
        return 3
    if number == 13:
        board.counters.offsets = 0
    return board.memory.store(number, float(value[0]), board.build)


def _store_start_up(board: Machine, line: str) -> Work:
    """`$Nx=line`: kept where it is valid, for which it is executed."""
    if board.state != "Idle":
        return 8
    number, text, error = _assignment(line[2:])
    if error or number >= len(board.memory.start_up):
        return error or 3
    if len(text) > board.build.stored_line_length:
        return 14
    code = yield from execute_gcode(board, text)
    if not code:
        board.memory.start_up[number] = text
    return code


def _assignment(text: str) -> tuple[int, str, int]:
    """Number, what stands behind `=`, and the error in `number=...`, 0 where there is none."""
    number = NUMBER.match(text)
    if number is None:
        return 0, "", 2
    head, equals, rest = text[: number.end()], text[number.end() : number.end() + 1], text[number.end() + 1 :]
    return int(float(head)), rest, 0 if equals == "=" else 3
