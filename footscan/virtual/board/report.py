"""What the virtual board writes about itself: status reports, modes, parameters, build."""

from __future__ import annotations

from footscan.virtual.board.gcode import MM_PER_INCH
from footscan.virtual.board.machine import Machine
from footscan.virtual.board.memory import SYSTEMS
from footscan.virtual.board.rails import Triple

HELP = "[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]"
OFFSETS_BUSY, OFFSETS_IDLE = 30, 10
OVERRIDES_BUSY, OVERRIDES_IDLE = 20, 10


def status_report(board: Machine) -> str:
    """The answer to `?`."""
    state = board.state if board.substate is None else f"{board.state}:{board.substate}"
    mask = int(board.memory[10])
    position = counted(board)
    kind = "MPos"
    if not mask & 1:
        kind = "WPos"
        at, off = position, board.offsets.total
        position = (at[0] - off[0], at[1] - off[1], at[2] - off[2])
    fields = [state, f"{kind}:{_lengths(board, position)}"]
    if mask & 2:
        fields.append(f"Bf:{15 - len(board.motion.queue)},{128 - len(board.received)}")
    rate = board.motion.speed * 60.0 / _unit(board)
    fields.append(f"FS:{rate:.0f},{board.motion.light_at(board.motion.moment) * board.memory[30]:.0f}")
    pins = "P" * board.pins.probe + "".join(a for a, on in zip("XYZ", board.motion.pressed(), strict=True) if on)
    if pins or board.door_ajar:
        fields.append(f"Pn:{pins}{'D' * board.door_ajar}")
    return f"<{'|'.join(fields + _now_and_then(board))}>"


def modes_report(board: Machine) -> str:
    """The answer to `$G`."""
    m = board.modes
    words = [m.motion, m.system, m.plane, m.units, m.distance, m.feed_mode, m.spindle, m.coolant]
    return f"[GC:{' '.join(words)} T{m.tool} F{m.feed / _unit(board):.0f} S{m.power:.0f}]"


def parameters_report(board: Machine) -> list[str] | None:
    """The answer to `$#`; None where a coordinate system cannot be read."""
    lines = []
    for name in SYSTEMS:
        content = board.memory.recall(name)
        if content is None:
            return None
        lines.append(f"[{name}:{_lengths(board, content)}]")
    lines.append(f"[G92:{_lengths(board, board.offsets.shifted)}]")
    lines.append(f"[TLO:{board.offsets.tool / _unit(board):.3f}]")
    return [*lines, probe_report(board)]


def probe_report(board: Machine) -> str:
    """Where the probe last touched, and whether it did."""
    at, touched = board.probed
    return f"[PRB:{_lengths(board, at)}:{int(touched)}]"


def build_report(board: Machine) -> list[str]:
    """The answer to `$I`."""
    build = board.build
    return [f"[VER:{build.version}.{build.built}:{board.memory.name}]", f"[OPT:{build.options},15,128]"]


def counted(board: Machine) -> Triple:
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
        fields.append(f"WCO:{_lengths(board, board.offsets.total)}")
    if counters.overrides > 0:
        counters.overrides -= 1
    else:
        counters.overrides = (OVERRIDES_BUSY if busy else OVERRIDES_IDLE) - 1
        now = board.overrides
        fields.append(f"Ov:{now.feed},{now.rapid},{now.light}")
        lit = {"M3": "S", "M4": "C"}.get(board.modes.spindle, "") + "F" * (board.modes.coolant == "M8")
        if lit:
            fields.append(f"A:{lit}")
    return fields


def _lengths(board: Machine, values: Triple) -> str:
    decimals = 4 if board.memory.flag(13) else 3
    return ",".join(f"{value / _unit(board):.{decimals}f}" for value in values)


def _unit(board: Machine) -> float:
    return MM_PER_INCH if board.memory.flag(13) else 1.0
