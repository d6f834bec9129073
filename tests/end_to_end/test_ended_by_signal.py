"""The real command, told to end while it moves heads or lights: dark and standing within 0.3 s of the signal."""

import fcntl
import os
import pty
import re
import signal
import termios
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from live_command import COMMANDS, WITHIN_SECONDS, Scanner, order, scanners
from waiting import LONG_SECONDS

pytestmark = pytest.mark.real_time  # a process is to stop within 0.3 s of a signal

MOTION_SECONDS = {"jog": 6.0, "scan": 6.5}
"""Longer than the motion of a command that is left alone: 380 mm of a jog take 4 s, 200 mm of a scan 5.5 s."""
AS_FAR: dict[str, tuple[str, ...]] = {"jog": (), "scan": ("--to-mm", "200")}
ENDS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129, signal.SIGQUIT: 131}


@pytest.fixture
def scanner(tmp_path: Path) -> Iterator[Scanner]:
    yield from scanners(tmp_path, (-6.0, -6.0, -6.0))


@pytest.fixture
def far(tmp_path: Path) -> Iterator[Scanner]:
    yield from scanners(tmp_path, (-200.0, -200.0, -200.0))


@pytest.mark.parametrize(
    ("name", "number"),
    [
        pytest.param(name, number, id=f"{name}-{number.name}", marks=() if is_quick else pytest.mark.slow)
        for name in COMMANDS
        for number in ENDS
        for is_quick in [name == "jog" or number == signal.SIGTERM]
    ],
)
def test_heads_and_lasers_stop_within_a_moment(name: str, number: int, request: pytest.FixtureRequest) -> None:
    scanner: Scanner = request.getfixturevalue("far" if name == "home" else "scanner")
    process = scanner.started(name)
    signalled = time.monotonic()
    process.send_signal(number)
    time.sleep(WITHIN_SECONDS)
    said = process.communicate(timeout=LONG_SECONDS)[1]
    time.sleep(0.5)
    scanner.assert_dark_and_standing(signalled + WITHIN_SECONDS)
    last = said.splitlines()[-1]
    if name == "console" and number in {signal.SIGINT, signal.SIGTERM}:
        assert (process.returncode, last) == (0, "the lasers are off, the console has ended")
    else:
        assert process.returncode == ENDS[signal.Signals(number)]
        assert last.startswith(f"footscan: ended by {signal.Signals(number).name}: heads and lasers are stopped")
    assert "Traceback" not in said


@pytest.mark.parametrize("name", ["jog", "scan", "console"])
def test_a_signal_that_comes_again_changes_nothing(scanner: Scanner, name: str) -> None:
    process = scanner.started(name)
    signalled = time.monotonic()
    for number in (signal.SIGTERM, signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        process.send_signal(number)
        time.sleep(0.03)
    said = process.communicate(timeout=LONG_SECONDS)[1]
    time.sleep(0.5)
    scanner.assert_dark_and_standing(signalled + WITHIN_SECONDS)
    assert process.returncode == (0 if name == "console" else 143)
    assert "Traceback" not in said


@pytest.mark.parametrize("name", ["jog", "scan", "console"])
def test_heads_stop_when_the_terminal_goes_away(scanner: Scanner, name: str) -> None:
    """The command is the terminal's foreground job: it hears SIGHUP, and whatever it says then fails with EIO."""
    ours, terminal = pty.openpty()
    process = scanner.start(
        name, stdin=terminal, stdout=terminal, stderr=terminal, start_new_session=True, preexec_fn=_own_terminal
    )
    os.close(terminal)
    if name == "console":
        address = ""
        while not (found := re.search(r"http://\S+", address)):
            address += os.read(ours, 4096).decode()
        order(found[0], "connect", when_idle=True)
        order(found[0], "scan", b'{"patient": "P1", "side": "right"}', when_idle=True)
    scanner.wait_until_busy(name, process)
    gone = time.monotonic()
    os.close(ours)
    assert process.wait(LONG_SECONDS) == 129
    time.sleep(0.5)
    scanner.assert_dark_and_standing(gone + WITHIN_SECONDS)


def _own_terminal() -> None:
    """Makes the terminal on standard input that of the session."""
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


def test_heads_stop_before_the_program_is_suspended(scanner: Scanner) -> None:
    process = scanner.started("jog")
    signalled = time.monotonic()
    process.send_signal(signal.SIGTSTP)
    _, status = os.waitpid(process.pid, os.WUNTRACED)
    assert os.WIFSTOPPED(status)
    time.sleep(1.0)
    scanner.assert_dark_and_standing(signalled + WITHIN_SECONDS)
    process.send_signal(signal.SIGCONT)
    said = process.communicate(timeout=LONG_SECONDS)[1]
    scanner.assert_dark_and_standing(signalled + WITHIN_SECONDS)
    assert process.returncode == 3
    assert "footscan: the heads were stopped at X = " in said


def test_output_that_nobody_reads_leaves_nothing_moving(scanner: Scanner) -> None:
    process = scanner.started("jog")
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    process.stderr.close()
    assert process.wait(LONG_SECONDS) in (0, 1)  # 1 where Python hands on each line at once, and notices
    time.sleep(0.3)
    scanner.assert_dark_and_standing(time.monotonic() - 0.3)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
@pytest.mark.parametrize("name", ["jog", pytest.param("scan", marks=pytest.mark.slow)])
def test_a_command_that_is_killed_or_halted_ends_with_its_motion(scanner: Scanner, name: str, number: int) -> None:
    process = scanner.started(name, AS_FAR[name])
    signalled = time.monotonic()
    process.send_signal(number)
    time.sleep(MOTION_SECONDS[name] + 1.0)
    scanner.assert_dark_and_standing(signalled + MOTION_SECONDS[name])
    assert 50.0 < scanner.board.position_at(time.monotonic())[0] < 410.1  # as far as heads reach
