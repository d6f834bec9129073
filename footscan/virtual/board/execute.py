"""What the virtual board does for a line of G-code, a jog and the homing cycle: step by step, waiting in between."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import replace

from footscan.virtual.board.gcode import Block, GcodeError, Modes, read_block
from footscan.virtual.board.machine import Machine, Work
from footscan.virtual.board.motion import LaserPower, Move
from footscan.virtual.board.rails import Triple

SEARCH, LOCATE = 1.5, 5.0
"""Homing searches a switch over 1.5 times the largest travel, and locates it again over 5 times the pull-off (Grbl's
HOMING_AXIS_SEARCH_SCALAR and HOMING_AXIS_LOCATE_SCALAR)."""


def execute_gcode(board: Machine, line: str) -> Work:
    """One block; the number of its error, 0 for `ok`."""
    try:
        block = read_block(line, board.modes, board.where)
    except GcodeError as error:
        return error.number
    yield from _set_light(board, block)
    if block.dwell is not None:
        yield from _all_done(board)
        yield _until(board, board.now + block.dwell)
    board.modes = block.modes
    if block.moves:
        feed = block.modes.feed
        light = _light(board, block.modes, feed)
        yield from _queue(board, block.target, feed / 60.0, light, "Run", rapid=block.modes.motion == "G0")
    return 0


def jog(board: Machine, line: str) -> Work:
    """`$J=line`."""
    try:
        block = read_block(line, board.modes, board.where, jog=True)
    except GcodeError as error:
        return error.number
    if board.memory.flag(20) and _beyond(board, block.target):
        return 15
    light = _light(board, replace(board.modes, motion="G1"), block.modes.feed)
    yield from _queue(board, block.target, block.modes.feed / 60.0, light, "Jog", fixed_feed=True)
    return 0


def home(board: Machine) -> Work:
    """`$H`: each cycle finds its switches quickly, pulls off, finds them slowly, pulls off."""
    board.state = "Home"
    for cycle in board.build.homing_cycles:
        failed = yield from _home_cycle(board, cycle)
        if failed:
            board.alarm(failed)
            board.restart(after_alarm=True)
            yield lambda: False
    board.motion.locked = [False, False, False]
    board.motion.watch = "none"
    board.answer_query()  # of all queries since it began, before its own `ok`
    board.where = board.motion.steps
    board.state = "Idle"
    return 0


def _home_cycle(board: Machine, cycle: tuple[int, ...]) -> Generator[Callable[[], bool], None, int]:
    """The number of the alarm it ends with, 0 where it found its switches."""
    memory, motion = board.memory, board.motion
    pull_off, seek = memory[27], memory[25] / 60.0
    search = SEARCH * max(memory[130 + axis] for axis in cycle)
    phases = (
        (True, seek, search),
        (False, seek, pull_off),
        (True, memory[24] / 60.0, LOCATE * pull_off),
        (False, seek, pull_off),
    )
    for approach, speed, distance in phases:
        motion.locked = [axis not in cycle for axis in range(3)]
        motion.watch = "homing" if approach else "none"
        if approach and all(on or axis not in cycle for axis, on in enumerate(motion.pressed())):
            motion.locked = [True, True, True]  # they stand on their switches already
        else:
            _drive(board, cycle, speed, distance if approach else -distance)
            yield lambda: not motion.queue
        if approach and not all(motion.locked):
            return 10 if board.second_switch_missing else 9
        if not approach and any(motion.pressed()[axis] for axis in cycle):
            return 8
        yield _until(board, board.now + memory[26] / 1000.0)
    steps = list(motion.steps)
    for axis in cycle:
        negative = int(memory[23]) >> axis & 1
        steps[axis] = pull_off - memory[130 + axis] if negative else -pull_off
    motion.steps = (steps[0], steps[1], steps[2])
    return 0


def _drive(board: Machine, cycle: tuple[int, ...], speed: float, distance: float) -> None:
    """All axes of a cycle at the same speed, each until it is locked."""
    toward = [0.0, 0.0, 0.0]
    for axis in cycle:
        toward[axis] = -distance if int(board.memory[23]) >> axis & 1 else distance
    steps = board.motion.steps
    target = (steps[0] + toward[0], steps[1] + toward[1], steps[2] + toward[2])
    board.motion.add(_move(board, steps, target, speed * math.sqrt(len(cycle)), LaserPower(), fixed_feed=True))


def _queue(
    board: Machine,
    target: Triple,
    speed: float,
    light: LaserPower,
    state: str,
    *,
    rapid: bool = False,
    fixed_feed: bool = False,
) -> Work:
    if state != "Jog" and board.memory.flag(20) and _beyond(board, target):
        yield from _refuse_target(board)
    yield board.plan_has_room
    if target != board.where:
        move = _move(board, board.where, target, speed, light, rapid=rapid, fixed_feed=fixed_feed)
        board.begin("Jog" if state == "Jog" else "Run")
        board.motion.add(move)
        board.where = target
    return 0


def _move(
    board: Machine,
    begin: Triple,
    target: Triple,
    speed: float,
    light: LaserPower,
    *,
    rapid: bool = False,
    fixed_feed: bool = False,
) -> Move:
    along = [b - a for a, b in zip(begin, target, strict=True)]
    length = math.hypot(*along)
    unit = (along[0] / length, along[1] / length, along[2] / length)
    limit, acceleration = (
        min(most / abs(u) for most, u in zip(board.memory.axes(first), unit, strict=True) if u) for first in (110, 120)
    )
    if board.state == "Home":
        limit = math.inf  # it homes as fast as the settings of homing say
    return Move(target, unit, length, speed, limit / 60.0, acceleration, light, rapid, fixed_feed)


def _refuse_target(board: Machine) -> Work:
    """A target beyond the soft limits: a controlled stop, then an alarm that keeps the position."""
    if board.state == "Run":
        board.motion.holding = True
        yield lambda: board.motion.speed == 0.0
    board.motion.flush()
    board.alarm(2)
    yield lambda: False
    return 0


def _set_light(board: Machine, block: Block) -> Work:
    """S, M3, M4 and M5. In laser mode a change of S that comes with a motion goes with it, without a stop."""
    laser = board.memory.flag(32)
    old, new = board.modes, block.modes
    dark = laser and new.motion == "G0"
    turned_dark = laser and old.spindle == "M3" and dark != (old.motion == "G0")
    if (new.power != old.power or turned_dark) and old.spindle != "M5" and not (laser and block.moves):
        yield from _all_done(board)
        _shine(board, old.spindle, 0.0 if dark else new.power)
    if new.spindle != old.spindle:
        yield from _all_done(board)
        _shine(board, new.spindle, 0.0 if dark else new.power)
    elif laser and new.spindle == "M3" and block.moves and block.target == board.where:
        yield from _all_done(board)
        _shine(board, "M3", 0.0 if dark else new.power)
    return 0


def _shine(board: Machine, spindle: str, power: float) -> None:
    """Light on heads that stand: under M4 there is none in laser mode."""
    off = spindle == "M5" or (board.memory.flag(32) and spindle == "M4")
    board.motion.stand_in_light(LaserPower() if off else LaserPower(_level(board, power)))
    board.counters.overrides = 0


def _light(board: Machine, modes: Modes, feed: float) -> LaserPower:
    """Light on a motion: under M4 it follows the speed, with its full level at the programmed one."""
    if modes.spindle == "M5":
        return LaserPower()
    if not board.memory.flag(32):
        return LaserPower(_level(board, modes.power))
    if modes.motion == "G0":
        return LaserPower()
    return LaserPower(_level(board, modes.power), feed / 60.0 if modes.spindle == "M4" else None)


def _level(board: Machine, power: float) -> float:
    """The share of full power that S stands for, between the settings $31 and $30."""
    most, least = board.memory[30], board.memory[31]
    if power == 0.0:
        return 0.0
    return 1.0 if least >= most else min(max(power, least), most) / most


def _all_done(board: Machine) -> Work:
    yield board.is_still
    if board.state == "Run":
        board.state = "Idle"
    return 0


def _until(board: Machine, seconds: float) -> Callable[[], bool]:
    return lambda: board.now >= seconds


def _beyond(board: Machine, target: Triple) -> bool:
    return any(at > 0.0 or at < -travel for at, travel in zip(target, board.memory.axes(130), strict=True))
