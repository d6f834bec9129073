"""The controller and the virtual board on one terminal."""

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from waiting import LONG_SECONDS, fault_of, wait_until

from footscan.capture.board.controller import Controller
from footscan.capture.grbl.settings import required_settings
from footscan.virtual.board.board import Board
from footscan.virtual.board.memory import FACTORY, Build
from schemas.base.errors import Fault, RefusedInput
from schemas.rig import RigBoard

pytestmark = pytest.mark.real_time  # the board answers on a terminal of the system

HOMING_SECONDS = 60.0
SETTINGS = RigBoard(
    max_mm_per_s=(400.0, 400.0, 400.0),
    mm_per_s2=(16000.0, 16000.0, 16000.0),
    homing_mm_per_s=400.0,
    homing_slow_mm_per_s=100.0,
)
QUICK = {**required_settings(SETTINGS), 26: 5}


@pytest.fixture
def board() -> Iterator[Board]:
    with Board(settings=QUICK, heads_at=(-12.0, -8.0, -20.0)) as one:
        yield one


@pytest.fixture
def controller(board: Board) -> Iterator[Controller]:
    with Controller(board.port, SETTINGS) as one:
        yield one


def test_connecting_tells_firmware_and_state(controller: Controller) -> None:
    assert controller.version == "1.1h"
    assert controller.watches_door
    assert controller.state.name == "not homed"
    assert str(controller.state) == "where the heads stand is not known; home the heads"


def test_a_board_that_takes_long_to_start_is_waited_for() -> None:
    with Board(settings=QUICK, boot_seconds=1.5) as board, Controller(board.port, SETTINGS) as controller:
        assert controller.state.name == "not homed"


def test_no_port() -> None:
    with pytest.raises(
        RefusedInput, match=r"/dev/nowhere: cannot be opened \(No such file or directory\), expected the"
    ):
        Controller("/dev/nowhere")


def test_no_grbl(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("footscan.capture.board.controller.CONNECT_SECONDS", 0.5)
    ends = os.openpty()
    with pytest.raises(RefusedInput, match=r"nothing there speaks as Grbl does, expected a board with Grbl 1\.1"):
        Controller(os.ttyname(ends[1]))
    for end in ends:
        os.close(end)


def test_an_older_grbl() -> None:
    with (
        Board(build=Build(version="0.9j")) as board,
        pytest.raises(RefusedInput, match=r"a board with Grbl 0\.9j, expected Grbl 1\.1"),
    ):
        Controller(board.port)


def test_a_port_in_use(board: Board, controller: Controller) -> None:
    assert controller.state.name == "not homed"
    with pytest.raises(Fault, match="another program is using this port"):
        Controller(board.port)


def test_a_wrong_setting_is_refused(board: Board) -> None:
    board.memory.settings[32] = 0
    with pytest.raises(RefusedInput, match=r"\$32 \(laser mode\): is 0, expected 1: send \$32=1"):
        Controller(board.port, SETTINGS)


def test_a_board_as_it_comes_is_set_up() -> None:
    with Board(settings=FACTORY) as board, Controller(board.port) as controller:
        sent = controller.apply(SETTINGS)
        assert sent[0] == "$22=1"
        assert "$32=1" in sent
        assert controller.apply(SETTINGS) == []
        assert board.memory[110] == 24000.0


def test_homing(board: Board, controller: Controller) -> None:
    controller.home(HOMING_SECONDS)
    assert controller.homed
    assert controller.state.name == "ready"
    assert controller.status().report.machine_mm == (-2.0, -2.0, -2.0)
    assert board.position_at(time.monotonic()) == pytest.approx((-18.0, -18.0, -18.0))


def test_a_homing_that_takes_longer_than_patience_is_not_disturbed(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = {**QUICK, 25: 600}
    with (
        Board(settings=slow, heads_at=(-12.0, -8.0, -20.0)) as board,
        Controller(board.port, patience_seconds=0.3) as controller,
    ):
        resets: list[str] = []
        reset = board.firmware.reset
        monkeypatch.setattr(board.firmware, "reset", lambda: (resets.append(board.firmware.state), reset()))
        began = time.monotonic()
        controller.home(HOMING_SECONDS)
        assert time.monotonic() - began > 2.0
        time.sleep(0.5)
        assert controller.state.name == "ready"
        assert resets == ["Alarm"]  # before it began


def test_homing_with_a_stuck_head_names_it(board: Board, controller: Controller) -> None:
    board.stick(3)
    with pytest.raises(
        Fault, match=r"a head never reached its home switch; .*\(alarm 9\) \(end switches pressed: none\)"
    ):
        controller.home(HOMING_SECONDS)
    assert controller.state.name == "alarm"
    board.stick(3, False)
    controller.home(HOMING_SECONDS)
    assert controller.state.name == "ready"


def test_the_switches_of_heads_that_got_there_are_told(board: Board, controller: Controller) -> None:
    board.stick(1)  # heads 1 and 2 are homed together, behind head 3
    with pytest.raises(Fault, match=r"\(end switches pressed: head 2\)"):
        controller.home(HOMING_SECONDS)


def test_a_line_that_is_not_taken_is_told_with_its_number(controller: Controller) -> None:
    controller.home(HOMING_SECONDS)
    with pytest.raises(Fault, match=r"line 2: the board did not take G1X: .* \(error 2\)"):
        controller.stream(["G1X-10F600", "G1X", "G1X-50"], limit_seconds=5.0)
    assert controller.status().report.state == "Idle"
    at = controller.status().report.machine_mm
    assert at is not None
    assert at[0] > -12.0, "what stood behind it was not executed"
    assert controller.homed


def test_streaming_more_than_the_buffer_holds(controller: Controller) -> None:
    controller.home(HOMING_SECONDS)
    controller.stream(["G1F6000", *(f"G1X-{2 + k / 10:.3f}Y-2.000Z-2.000" for k in range(100))], limit_seconds=5.0)
    controller.send("G4P0.01", limit_seconds=5.0)
    assert controller.status().report.machine_mm == (-11.9, -2.0, -2.0)


def test_a_line_that_is_too_long_is_refused(controller: Controller) -> None:
    with pytest.raises(RefusedInput, match="expected one line of 79 characters at most"):
        controller.send("G1" + "0" * 80)


def test_soft_limit_alarm_and_the_way_back(controller: Controller) -> None:
    controller.home(HOMING_SECONDS)
    with pytest.raises(Fault, match=r"beyond the end of the rails .* \(alarm 2\)"):
        controller.send("G0X-999", limit_seconds=5.0)
    assert controller.state.name == "alarm"
    with pytest.raises(Fault, match=r"\(alarm 2\)"):
        controller.send("G0X-3")
    controller.home(HOMING_SECONDS)
    assert controller.state.name == "ready"


def test_hard_limit_alarm_and_the_way_back(board: Board, controller: Controller) -> None:
    controller.home(HOMING_SECONDS)
    board.lose_steps(2, 1.0)
    with pytest.raises(Fault, match=r"ran onto an end switch .* \(alarm 1\)"):
        controller.stream(["G1X-1Y-0.5F600", "G4P0.01"], limit_seconds=5.0)
    assert controller.state.name == "alarm"
    assert not controller.homed
    controller.home(HOMING_SECONDS)
    assert board.position_at(time.monotonic()) == pytest.approx((-18.0, -18.0, -18.0))


def test_jog_unhomed_after_unlocking(board: Board, controller: Controller) -> None:
    with pytest.raises(Fault, match="only while heads stand"):
        controller.jog((-5.0, 0.0, 0.0), 20.0)
    controller.unlock()
    assert controller.state.name == "not homed"
    before = board.position_at(time.monotonic())
    controller.jog((-5.0, 0.0, 0.0), 20.0)
    wait_until(lambda: controller.status().report.state == "Idle")
    after = board.position_at(time.monotonic())
    assert after[0] - before[0] == pytest.approx(5.0)
    assert after[1:] == before[1:]


def test_hold_and_resume(board: Board, controller: Controller) -> None:
    controller.home(HOMING_SECONDS)
    travel = threading.Thread(
        target=controller.stream, args=(["G1X-100F6000", "G4P0.01"],), kwargs={"limit_seconds": 9.0}
    )
    travel.start()
    wait_until(lambda: controller.state.name == "moving")
    controller.hold()
    wait_until(lambda: "are held" in controller.state.words)
    at = board.position_at(time.monotonic())
    time.sleep(0.2)
    assert board.position_at(time.monotonic()) == at
    controller.resume()
    travel.join(LONG_SECONDS)
    assert controller.status().report.machine_mm == (-100.0, -2.0, -2.0)
    assert controller.homed


def test_stop_keeps_the_position(board: Board, controller: Controller) -> None:
    controller.home(HOMING_SECONDS)
    failed: list[str] = []
    travel = threading.Thread(
        target=lambda: failed.append(fault_of(lambda: controller.stream(MOVE, limit_seconds=9.0)))
    )
    travel.start()
    wait_until(lambda: controller.state.name == "moving")
    controller.stop()
    travel.join(LONG_SECONDS)
    assert failed in (["line 1: stopped"], ["line 2: stopped"])
    assert controller.state.name == "ready"
    at = controller.status().report.machine_mm
    assert at is not None
    assert board.position_at(time.monotonic())[0] == pytest.approx(-20.0 - at[0], abs=0.02)


MOVE = ["G1X-400F3000", "G4P0.01"]


def test_a_reset_in_motion_ends_it_and_the_position(controller: Controller) -> None:
    controller.home(HOMING_SECONDS)
    failed: list[str] = []
    travel = threading.Thread(
        target=lambda: failed.append(fault_of(lambda: controller.stream(MOVE, limit_seconds=9.0)))
    )
    travel.start()
    wait_until(lambda: controller.state.name == "moving")
    controller.reset()
    travel.join(LONG_SECONDS)
    assert failed
    wait_until(lambda: controller.state.name == "alarm")
    assert "(alarm 3)" in controller.state.words


def test_an_answer_too_many_is_not_believed(board: Board, controller: Controller) -> None:
    controller.home(HOMING_SECONDS)
    board.line.write("ok", time.monotonic())
    wait_until(lambda: controller.state.name == "restarting")
    wait_until(lambda: controller.state.name == "ready")


def test_an_answer_that_never_comes(board: Board) -> None:
    with Controller(board.port, SETTINGS, patience_seconds=0.5) as controller:
        controller.home(HOMING_SECONDS)
        said = board.firmware.say
        board.firmware.say = lambda text: None if text == "ok" else said(text)
        with pytest.raises(Fault, match="the board gave no answer to G0X-3 and was reset"):
            controller.send("G0X-3")
        board.firmware.say = said
        wait_until(lambda: controller.state.name == "ready")


def test_a_board_that_hangs_is_told_as_lost(board: Board) -> None:
    with Controller(board.port, SETTINGS, patience_seconds=0.3) as controller:
        board.frozen = True
        wait_until(lambda: controller.state.name == "lost")
        assert "it does not answer, not even to a reset" in controller.state.words
        assert "switch off the board's power" in controller.state.remedy
        with pytest.raises(Fault, match="the connection to the board is lost"):
            controller.send("$I")


def test_a_board_that_hangs_for_a_moment_comes_back(board: Board) -> None:
    with Controller(board.port, SETTINGS, patience_seconds=0.5) as controller:
        board.frozen = True
        wait_until(lambda: controller.state.name == "restarting")
        board.frozen = False
        wait_until(lambda: controller.state.name == "not homed")


def test_a_pulled_cable_is_told(board: Board, controller: Controller) -> None:
    board.pull_cable()
    wait_until(lambda: controller.state.name == "lost")
    assert "unplugged" in controller.state.words
    board.plug_cable()
    controller.close()
    with Controller(board.port, SETTINGS) as again:
        again.home(HOMING_SECONDS)
        assert again.state.name == "ready"


def test_a_board_that_restarts_by_itself_has_lost_its_home(board: Board, controller: Controller) -> None:
    controller.home(HOMING_SECONDS)
    board.restart()
    wait_until(lambda: controller.state.name in ("alarm", "not homed"))
    assert not controller.homed


def test_reports_are_timed(board: Board, controller: Controller) -> None:
    controller.home(HOMING_SECONDS)
    told = []
    controller.on_report(told.append)
    controller.stream(["G1X-100F6000", "G4P0.01"], limit_seconds=5.0)
    told = [report for report in told if report.uncertain_seconds < 0.1]
    assert len(told) >= 3
    for report in told:
        assert report.asked <= report.seconds
        assert report.report.machine_mm is not None
        early, late = (
            -20.0 - board.position_at(report.seconds + by * report.uncertain_seconds)[0] for by in (-1.0, 1.0)
        )
        assert late - 0.0126 <= report.report.machine_mm[0] <= early + 0.0126, "true at its time, but for a step"


def test_no_thread_is_left_behind(board: Board) -> None:
    before = threading.active_count()
    with Controller(board.port, SETTINGS):
        assert threading.active_count() == before + 2
    assert threading.active_count() == before


def test_a_closed_controller_refuses(board: Board) -> None:
    with Controller(board.port, SETTINGS) as controller:
        pass
    assert controller.state.name == "closed"
    controller.close()
    with pytest.raises(Fault):
        controller.send("$I")


def test_a_port_that_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "port").write_text("")
    with pytest.raises(RefusedInput, match="cannot be opened"):
        Controller(str(tmp_path / "port"))
