"""Every error of the virtual board, and what a line with an error leaves as it was."""

from collections.abc import Callable, Mapping

import pytest
from board_bench import Bench, home

from footscan.virtual.board.memory import Build

# --- Error codes


def no_preparation(_: Bench) -> None:
    """The board as it is after homing."""


def in_motion(bench: Bench) -> None:
    bench.send("G1 X-100 F100\n")


def door_open(bench: Bench) -> None:
    bench.send("\x18")
    bench.firmware.state = "Alarm"
    bench.firmware.pins.door_open = True


ERRORS: list[tuple[int, str, Mapping[int, float], Build, Callable[[Bench], None]]] = [
    (1, "G1 X-3 F100 %", {}, Build(), no_preparation),
    (1, "1G", {}, Build(), no_preparation),
    (2, "G1 X F100", {}, Build(), no_preparation),
    (2, "$110=fast", {}, Build(), no_preparation),
    (3, "$99=1", {}, Build(), no_preparation),
    (3, "$XX", {}, Build(), no_preparation),
    (3, "$G", {}, Build(), no_preparation),
    (3, "$#", {}, Build(), no_preparation),
    (3, "$C", {}, Build(), no_preparation),
    (3, "$N", {}, Build(), no_preparation),
    (3, "$N0=G21", {}, Build(), no_preparation),
    (3, "$SLP", {}, Build(), no_preparation),
    (3, "$RST=$", {}, Build(), no_preparation),
    (3, "$I=left leg", {}, Build(), no_preparation),
    (4, "$110=-1", {}, Build(), no_preparation),
    (4, "G1 X-3 F-100", {}, Build(), no_preparation),
    (5, "$H", {20: 0, 22: 0}, Build(), no_preparation),
    (6, "$0=2", {}, Build(), no_preparation),
    (8, "$H", {}, Build(), in_motion),
    (8, "$$", {}, Build(), in_motion),
    (10, "$20=1", {20: 0, 22: 0}, Build(), no_preparation),
    (11, "G1" + "X-3" * 30, {}, Build(), no_preparation),
    (13, "$X", {}, Build(), door_open),
    (13, "$H", {}, Build(), door_open),
    (15, "$J=X10 F100", {}, Build(), no_preparation),
    (16, "$J=X-3 F100 M3", {}, Build(), no_preparation),
    (17, "$32=1", {}, Build(variable_spindle=False), no_preparation),
    (20, "G99", {}, Build(), no_preparation),
    (20, "M7", {}, Build(), no_preparation),
    (20, "A5", {}, Build(), no_preparation),
    (20, "G92.3", {}, Build(), no_preparation),
    (20, "G2 X-3 I1 F100", {}, Build(), no_preparation),
    (20, "G20", {}, Build(), no_preparation),
    (20, "G38.2 X-5 F100", {}, Build(), no_preparation),
    (20, "G43.1 Z1", {}, Build(), no_preparation),
    (20, "G92 X0", {}, Build(), no_preparation),
    (20, "G10 L2 P1 X1", {}, Build(), no_preparation),
    (20, "G28", {}, Build(), no_preparation),
    (20, "G54", {}, Build(), no_preparation),
    (20, "G17", {}, Build(), no_preparation),
    (20, "G93", {}, Build(), no_preparation),
    (20, "G80", {}, Build(), no_preparation),
    (20, "M0", {}, Build(), no_preparation),
    (20, "M2", {}, Build(), no_preparation),
    (20, "M8", {}, Build(), no_preparation),
    (20, "T1", {}, Build(), no_preparation),
    (20, "N1 G0 X-3", {}, Build(), no_preparation),
    (20, "G0 X-3 K4", {}, Build(), no_preparation),
    (21, "G90 G91", {}, Build(), no_preparation),
    (21, "M3 M4", {}, Build(), no_preparation),
    (22, "G1 X-3", {}, Build(), no_preparation),
    (22, "$J=X-3", {}, Build(), no_preparation),
    (23, "G1.5 X-3", {}, Build(), no_preparation),
    (23, "M3.1", {}, Build(), no_preparation),
    (24, "G0 G1 X-3 F100", {}, Build(), no_preparation),
    (25, "G0 X-3 X-4", {}, Build(), no_preparation),
    (28, "G4", {}, Build(), no_preparation),
    (36, "G0 X-3 P4", {}, Build(), no_preparation),
    (36, "$J=X-3 F100 S5", {}, Build(), no_preparation),
]


@pytest.mark.parametrize(("number", "line", "settings", "build", "prepare"), ERRORS)
def test_error(
    number: int, line: str, settings: Mapping[int, float], build: Build, prepare: Callable[[Bench], None]
) -> None:
    bench = Bench(settings, build)
    if bench.memory.flag(22):
        home(bench)
    prepare(bench)
    modes, where = bench.firmware.modes, bench.motion.steps
    assert bench.send(f"{line}\n") == [f"error:{number}"]
    if prepare is not in_motion:
        assert (bench.firmware.modes, bench.motion.steps) == (modes, where), "a line with an error does nothing"


def test_error_9_in_alarm_and_in_jogs(bench: Bench) -> None:
    assert bench.send("G0 X-3\n") == ["error:9"]
