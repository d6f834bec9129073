"""The virtual board's `$` commands: help, settings, build, jogs, homing, unlocking. All others are error 3."""

from __future__ import annotations

import re

from footscan.virtual.board.execute import home, jog
from footscan.virtual.board.machine import Machine, Work
from footscan.virtual.board.report import HELP, build_report

NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)")


def execute_system(board: Machine, line: str) -> Work:
    """One `$` command; the number of its error, 0 for `ok`."""
    command = line[1:2]
    if command == "J":
        return (yield from _jog(board, line))
    if command in "$X":
        return _at_any_time(board, line)
    if board.state not in ("Idle", "Alarm"):
        return 8
    if command == "H":
        return (yield from _home(board, line))
    if line == "$I":
        return _say_all(board, build_report(board))
    return 3 if command.isalpha() or command == "#" else _store(board, line)


def _jog(board: Machine, line: str) -> Work:
    if board.state not in ("Idle", "Jog"):
        return 8
    if line[2:3] != "=":
        return 3  # the documentation says 16, the firmware 3
    return (yield from jog(board, line[3:]))


def _at_any_time(board: Machine, line: str) -> int:
    match line:
        case "$":
            return _say_all(board, [HELP])
        case "$$" if board.state in ("Run", "Hold"):
            return 8
        case "$$":
            return _say_all(board, board.memory.printed())
        case "$X":
            return _unlock(board)
        case _:
            return 3


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


def _say_all(board: Machine, lines: list[str]) -> int:
    for line in lines:
        board.say(line)
    return 0


def _store(board: Machine, line: str) -> int:
    """`$x=val`."""
    name = NUMBER.match(line, 1)
    if name is None:
        return 2
    if line[name.end() : name.end() + 1] != "=":
        return 3
    number, text = int(float(name[0])), line[name.end() + 1 :]
    value = NUMBER.match(text)
    if value is None:
        return 2
    if value.end() != len(text) or not 0 <= number <= 255:
        return 3
    if number == 13:
        board.counters.offsets = 0
    return board.memory.store(number, float(value[0]), board.build)
