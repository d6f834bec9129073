"""The virtual board's cable: a pseudo-terminal under a name that stays, and what can happen to bytes on their way."""

import os
import select
import tty
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Direction = Literal["to board", "to host"]
Harm = Literal["lose", "double", "delay", "garbage"]

BYTES_PER_SECOND = 11_520.0
"""115,200 baud, ten bits a byte."""
GARBAGE = b"\xfe\x00}#\xb3"


@dataclass
class Mishap:
    """What happens once to bytes on the line."""

    direction: Direction
    harm: Harm
    after: int
    """How many bytes pass before."""
    count: int = 1
    """How many bytes are lost or doubled."""
    seconds: float = 0.0
    """How long all that follows is late."""


class BoardLine:
    """One end of the cable, the board's; the host opens `port`."""

    def __init__(self, port: Path) -> None:
        self.port = port
        """A symbolic link to the terminal, like the stable names of serial ports; missing while the cable is out."""
        self.mishaps: list[Mishap] = []
        self._waiting: dict[Direction, deque[tuple[float, bytes]]] = {"to board": deque(), "to host": deque()}
        self._late: dict[Direction, float] = {"to board": 0.0, "to host": 0.0}
        self._sent_until = 0.0
        self._board_end: int | None = None
        self._was_open = False
        self.plug()

    def plug(self) -> None:
        """Puts the cable in: a new terminal under the old name."""
        if self._board_end is None:
            board_end, host_end = os.openpty()
            tty.setraw(host_end)
            os.set_blocking(board_end, False)
            self.port.unlink(missing_ok=True)
            self.port.symlink_to(os.ttyname(host_end))
            os.close(host_end)
            self._board_end = board_end
            self._was_open = False

    def pull(self) -> None:
        """Pulls the cable: the host's end becomes an error, what is under way is lost."""
        if self._board_end is not None:
            self.port.unlink(missing_ok=True)
            os.close(self._board_end)
            self._board_end = None
            self._forget()

    def wait(self, seconds: float) -> bool:
        """Waits until bytes come in, at most so long; whether the host has just opened its end."""
        if self._board_end is None:
            select.select([], [], [], seconds)
            return False
        poll = select.poll()
        poll.register(self._board_end, select.POLLIN)
        events = dict(poll.poll(seconds * 1000.0)).get(self._board_end, 0)
        is_open = not events & select.POLLHUP
        opened, self._was_open = is_open and not self._was_open, is_open
        if opened:
            self._forget()
        if not is_open:
            select.select([], [], [], seconds)  # a terminal that nobody has open is always ready
        return opened

    def read(self, now: float) -> bytes:
        """What reaches the board by `now`."""
        if self._board_end is not None and self._was_open:
            try:
                data = os.read(self._board_end, 4096)
            except (BlockingIOError, OSError):
                data = b""
            self._pass("to board", data, now)
        return self._due("to board", now)

    def write(self, text: str, now: float) -> None:
        """Sends a line, as fast as the baud rate lets it."""
        data = f"{text}\r\n".encode("ascii")
        self._sent_until = max(self._sent_until, now) + len(data) / BYTES_PER_SECOND
        self._pass("to host", data, self._sent_until)

    def deliver(self, now: float) -> None:
        """Hands the host what reaches it by `now`."""
        data = self._due("to host", now)
        if data and self._board_end is not None and self._was_open:
            try:
                os.write(self._board_end, data)
            except (BlockingIOError, OSError):
                return  # a host that does not read loses what it does not read

    def next_due(self) -> float:
        """When something that is under way arrives; infinite where nothing is."""
        return min((queue[0][0] for queue in self._waiting.values() if queue), default=float("inf"))

    def _forget(self) -> None:
        """What was under way while nobody had the port open is lost."""
        for waiting in self._waiting.values():
            waiting.clear()

    def _pass(self, direction: Direction, data: bytes, when: float) -> None:
        if not data:
            return
        for mishap in [m for m in self.mishaps if m.direction == direction]:
            if mishap.after >= len(data):
                mishap.after -= len(data)
                continue
            data = self._harm(mishap, data)
            self.mishaps.remove(mishap)
        waiting = self._waiting[direction]
        due = max(when + self._late[direction], waiting[-1][0] if waiting else 0.0)
        self._late[direction] = 0.0
        waiting.append((due, data))

    def _harm(self, mishap: Mishap, data: bytes) -> bytes:
        head, rest = data[: mishap.after], data[mishap.after :]
        match mishap.harm:
            case "lose":
                return head + rest[mishap.count :]
            case "double":
                return head + rest[: mishap.count] + rest
            case "garbage":
                return head + (GARBAGE * mishap.count)[: mishap.count] + rest
            case "delay":
                self._late[mishap.direction] = mishap.seconds
                return data

    def _due(self, direction: Direction, now: float) -> bytes:
        waiting = self._waiting[direction]
        data = b""
        while waiting and waiting[0][0] <= now:
            data += waiting.popleft()[1]
        return data
