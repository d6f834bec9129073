"""The serial line on a terminal of our own."""

import os
import threading
import time
import tty
from collections.abc import Iterator

import pytest
from waiting import wait_until

from footscan.capture.grbl.serial_line import SerialLine
from schemas.base.errors import Fault, RefusedInput

pytestmark = pytest.mark.real_time  # a kernel's terminal carries the bytes


class Ends:
    """Both ends of a line, and what was heard at ours."""

    def __init__(self) -> None:
        self.other, ours = os.openpty()
        tty.setraw(ours)
        self.lines: list[tuple[str, float]] = []
        self.lost: list[str] = []
        self.line = SerialLine(os.ttyname(ours), lambda text, at: self.lines.append((text, at)), self.lost.append)
        os.close(ours)
        self.line.start()


@pytest.fixture
def ends() -> Iterator[Ends]:
    one = Ends()
    yield one
    one.line.close()
    if not one.lost:
        os.close(one.other)


def test_lines_come_whole_with_the_time_of_their_end(ends: Ends) -> None:
    os.write(ends.other, b"o")
    time.sleep(0.05)
    before = time.monotonic()
    os.write(ends.other, b"k\r\nerror:1\r\n")
    wait_until(lambda: len(ends.lines) == 2)
    assert [text for text, _ in ends.lines] == ["ok", "error:1"]
    assert before <= ends.lines[0][1] <= time.monotonic()


def test_bytes_that_are_no_text(ends: Ends) -> None:
    os.write(ends.other, b"o\xffk\r\n")
    wait_until(lambda: bool(ends.lines))
    assert ends.lines[0][0] == "o\ufffdk"


def test_noise_without_end_is_not_kept(ends: Ends) -> None:
    for _ in range(20):
        os.write(ends.other, b"x" * 100)
        time.sleep(0.005)
    os.write(ends.other, b"\n")
    wait_until(lambda: bool(ends.lines))
    assert len(ends.lines[0][0]) <= 600


def test_what_is_sent_arrives(ends: Ends) -> None:
    before = time.monotonic()
    assert before <= ends.line.write(b"?") <= time.monotonic()
    assert os.read(ends.other, 10) == b"?"


def test_loss_is_told_once(ends: Ends) -> None:
    os.close(ends.other)
    wait_until(lambda: bool(ends.lost))
    assert ends.lost == ["unplugged"]
    with pytest.raises(Fault, match="connection to the board is closed"):
        ends.line.write(b"?")
    assert ends.lost == ["unplugged"]


def test_closing_ends_the_thread() -> None:
    before = threading.active_count()
    one = Ends()
    one.line.close()
    assert threading.active_count() == before
    with pytest.raises(Fault):
        one.line.write(b"?")
    os.close(one.other)


@pytest.mark.parametrize("port", ["/dev/nowhere", "", "/"])
def test_no_port(port: str) -> None:
    with pytest.raises(RefusedInput, match="cannot be opened"):
        SerialLine(port, lambda *_: None, lambda _: None)
