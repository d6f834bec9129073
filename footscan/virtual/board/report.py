"""What the virtual board writes about itself: status reports and its build."""

from __future__ import annotations

from footscan.virtual.board.machine import Machine
from footscan.virtual.board.rails import Triple

HELP = "[HLP:$$ $I $x=val $J=line $X $H ~ ! ? ctrl-x]"
MM_PER_INCH = 25.4
NO_OFFSET: Triple = (0.0, 0.0, 0.0)
"""Machine minus work position: there is no coordinate system but the machine's."""
OFFSETS_BUSY, OFFSETS_IDLE = 30, 10
OVERRIDES_BUSY, OVERRIDES_IDLE = 20, 10


def status_report(board: Machine) -> str:
    """The answer to `?`."""
    state = board.state if board.substate is None else f"{board.state}:{board.substate}"
    mask = int(board.memory[10])
    fields = [state, f"{'MPos' if mask & 1 else 'WPos'}:{_lengths(board, _counted(board))}"]
    if mask & 2:
        fields.append(f"Bf:{15 - len(board.motion.queue)},{128 - len(board.received)}")
    rate = board.motion.speed * 60.0 / _unit(board)
    fields.append(f"FS:{rate:.0f},{board.motion.light_at(board.motion.moment) * board.memory[30]:.0f}")
    pins = "".join(a for a, on in zip("XYZ", board.motion.pressed(), strict=True) if on)
    if pins or board.door_ajar:
        fields.append(f"Pn:{pins}{'D' * board.door_ajar}")
    return f"<{'|'.join(fields + _now_and_then(board))}>"


def build_report(board: Machine) -> list[str]:
    """The answer to `$I`."""
    build = board.build
    return [f"[VER:{build.version}.{build.built}:]", f"[OPT:{build.options},15,128]"]


def _counted(board: Machine) -> Triple:
    """The machine position in whole steps, mm."""
    per_mm = board.memory.axes(100)
    a, b, c = (round(at * n) / n for at, n in zip(board.motion.steps, per_mm, strict=True))
    return a, b, c


def _now_and_then(board: Machine) -> list[str]:
    """Offsets and overrides: soon after a change, and every so many reports; never both in one."""
    busy = board.state in ("Home", "Run", "Hold", "Jog", "Door")
    counters, fields = board.counters, []
    if counters.offsets > 0:
        counters.offsets -= 1
    else:
        counters.offsets = (OFFSETS_BUSY if busy else OFFSETS_IDLE) - 1
        counters.overrides = max(counters.overrides, 1)
        fields.append(f"WCO:{_lengths(board, NO_OFFSET)}")
    if counters.overrides > 0:
        counters.overrides -= 1
    else:
        counters.overrides = (OVERRIDES_BUSY if busy else OVERRIDES_IDLE) - 1
        now = board.overrides
        fields.append(f"Ov:{now.feed},{now.rapid},{now.light}")
        lit = {"M3": "S", "M4": "C"}.get(board.modes.spindle)
        if lit:
            fields.append(f"A:{lit}")
    return fields


def _lengths(board: Machine, values: Triple) -> str:
    decimals = 4 if board.memory.flag(13) else 3
    return ",".join(f"{value / _unit(board):.{decimals}f}" for value in values)


def _unit(board: Machine) -> float:
    return MM_PER_INCH if board.memory.flag(13) else 1.0
