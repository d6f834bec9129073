"""Every error of Grbl 1.1 on the virtual board, and what a line with an error leaves as it was."""

from collections.abc import Callable, Mapping

import pytest
from board_bench import Bench, home

from footscan.virtual.board.firmware import Firmware
from footscan.virtual.board.memory import Build, Memory
from footscan.virtual.board.motion import Motion
from footscan.virtual.board.rails import Rail

# --- Error codes


def no_preparation(_: Bench) -> None:
    """The board as it is after homing."""


def in_motion(bench: Bench) -> None:
    bench.send("G1 X-100 F100\n")


def door_open(bench: Bench) -> None:
    bench.send("\x18")
    bench.firmware.state = "Alarm"
    bench.firmware.pins.door_open = True


def unreadable(bench: Bench) -> None:
    bench.memory.damaged.add("G55")


ERRORS: list[tuple[int, str, Mapping[int, float], Build, Callable[[Bench], None]]] = [
    (1, "G1 X-3 F100 %", {}, Build(), no_preparation),
    (1, "1G", {}, Build(), no_preparation),
    (2, "G1 X F100", {}, Build(), no_preparation),
    (2, "$110=fast", {}, Build(), no_preparation),
    (3, "$99=1", {}, Build(), no_preparation),
    (3, "$GG", {}, Build(), no_preparation),
    (4, "$110=-1", {}, Build(), no_preparation),
    (4, "G1 X-3 F-100", {}, Build(), no_preparation),
    (5, "$H", {20: 0, 22: 0}, Build(), no_preparation),
    (6, "$0=2", {}, Build(), no_preparation),
    (7, "G55", {}, Build(), unreadable),
    (8, "$H", {}, Build(), in_motion),
    (8, "$$", {}, Build(), in_motion),
    (10, "$20=1", {20: 0, 22: 0}, Build(), no_preparation),
    (11, "G1" + "X-3" * 30, {}, Build(), no_preparation),
    (12, "$110=60000", {}, Build(most_steps_per_second=30_000.0), no_preparation),
    (13, "$X", {}, Build(), door_open),
    (13, "$H", {}, Build(), door_open),
    (14, "$I=" + "x" * 90, {}, Build(line_length=256), no_preparation),
    (15, "$J=X10 F100", {}, Build(), no_preparation),
    (16, "$J=X-3 F100 M3", {}, Build(), no_preparation),
    (17, "$32=1", {}, Build(variable_spindle=False), no_preparation),
    (20, "G99", {}, Build(), no_preparation),
    (20, "M7", {}, Build(), no_preparation),
    (20, "A5", {}, Build(), no_preparation),
    (20, "G92.3", {}, Build(), no_preparation),
    (21, "G20 G21", {}, Build(), no_preparation),
    (21, "M3 M4", {}, Build(), no_preparation),
    (22, "G1 X-3", {}, Build(), no_preparation),
    (22, "$J=X-3", {}, Build(), no_preparation),
    (22, "G93 G1 X-3", {}, Build(), no_preparation),
    (23, "G1.5 X-3", {}, Build(), no_preparation),
    (23, "M3.1", {}, Build(), no_preparation),
    (24, "G0 G92 X1", {}, Build(), no_preparation),
    (25, "G0 X-3 X-4", {}, Build(), no_preparation),
    (26, "G92", {}, Build(), no_preparation),
    (26, "G2 I1 F100", {}, Build(), no_preparation),
    (27, "N10000001 G0", {}, Build(), no_preparation),
    (28, "G4", {}, Build(), no_preparation),
    (28, "G10 L2 X1", {}, Build(), no_preparation),
    (29, "G10 L2 P7 X1", {}, Build(), no_preparation),
    (30, "G53 G2 X-3 I1 F100", {}, Build(), no_preparation),
    (31, "G80 X-3", {}, Build(), no_preparation),
    (32, "G2 Z-3 I1 F100", {}, Build(), no_preparation),
    (33, "G2 X-30 I1 F100", {}, Build(), no_preparation),
    (33, "G38.2 X-2 F100", {}, Build(), no_preparation),
    (34, "G2 X-30 R1 F100", {}, Build(), no_preparation),
    (35, "G2 X-3 F100", {}, Build(), no_preparation),
    (36, "G0 X-3 K4", {}, Build(), no_preparation),
    (36, "$J=X-3 F100 S5", {}, Build(), no_preparation),
    (37, "G43.1 X1", {}, Build(), no_preparation),
    (38, "T256", {}, Build(), no_preparation),
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


def test_error_7_of_settings_that_cannot_be_read() -> None:
    memory = Memory()
    memory.damaged.add("settings")
    said: list[str] = []
    Firmware(Motion([Rail(), Rail(), Rail()], (0.0, 0.0, 0.0), 0.0), memory, Build(), said.append).power_up()
    assert said[0] == "error:7"
    assert said[1] == "$0=10"


def test_every_error_of_the_documentation_is_here() -> None:
    assert {number for number, *_ in ERRORS} | {9} == {*range(1, 18), *range(20, 39)}
