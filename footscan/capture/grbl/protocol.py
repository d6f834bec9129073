"""Grbl's protocol: lines are sent, and answers, alarms, restarts, silence and loss of the line are handled.

The board answers each line with `ok` or `error:N`, in the order of the lines. If an answer is missing or surplus, lines
and answers can no longer be matched: the board is reset at once, which ends motion and light, and all lines that wait
for an answer fail.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from footscan import clock
from footscan.capture.grbl.codes import alarm_in_words, error_in_words
from footscan.capture.grbl.report import Alarm, Answer, Feedback, Garbled, Message, Report, Welcome, read_line
from footscan.capture.grbl.serial_line import SerialLine
from footscan.capture.grbl.status_poll import LOST_QUERY_SECONDS, StatusPoll, TimedReport
from schemas.base.errors import Fault, RefusedInput

RX_BYTES = 127
"""Usable size of the receive buffer of 128 bytes of the board."""
LONGEST_LINE = 79
CLOSED = "closed"
"""Reason of the loss of a connection that this program closed."""
RESET = b"\x18"
RESETS = 3
"""Attempts of a reset, whose byte may be lost. Chosen by hand."""
LONGEST_HOLD_SECONDS = 600.0
"""A travel that is held, or waits for the lid, is given up after this time. Chosen by hand."""
DEAF = (1, 2)
"""Alarms after which the board accepts nothing but a reset."""
NO_RESTART = (*DEAF, 4, 5)
"""Alarms after which the firmware does not restart by itself."""
LOCKED = "'$H'|'$X' to unlock"


@dataclass
class Sent:
    """A line that was sent, and its answer."""

    line: str
    bytes: int
    error: int | None = None
    """0 for `ok`; None before the answer."""
    failed: str | None = None
    """Reason why no answer will come."""
    messages: list[Message] = field(default_factory=list)
    """Messages of the board while it executed this line."""


class GrblProtocol:
    """A serial line with a Grbl board behind it. All methods may be called from any thread."""

    def __init__(self, port: str, patience_seconds: float) -> None:
        """Open `port`; raises the errors of `SerialLine`. Lines can be sent after the first welcome."""
        self.patience_seconds = patience_seconds
        self.on_report: Callable[[TimedReport], None] | None = None
        """Called with each status report, in the thread that reads the line."""
        self.version = ""
        self.garbled = 0
        """Number of damaged lines that arrived."""
        self.homed = False
        """True if the firmware knows where the heads are; False after an alarm or a restart."""
        self.alarm: int | None = None
        """The latest alarm since the last homing."""
        self.deaf = False
        """True if the board accepts nothing but a reset."""
        self.restarting = True
        """True while a restart is under way."""
        self.lost: str | None = None
        """Reason why the connection is lost; None while it exists."""
        self.welcomes = 0
        self.standstills = 0
        """Number of welcomes and alarms: after each, motion and light have ended."""
        self.changed = threading.Condition()
        """Notified of every message of the board."""
        self._ending = False
        """True if answers are ignored until the board has restarted."""
        self._pending: deque[Sent] = deque()
        self._line = SerialLine(port, self._hear, self.lose)
        self.poll = StatusPoll(self.write, self._fall_silent, patience_seconds)
        self._line.start()

    def close(self) -> None:
        """End all threads; lines that wait for an answer fail."""
        self.poll.close()
        self.lose(CLOSED)
        self._line.close()

    def write(self, data: bytes) -> float:
        """Send realtime commands; returns the time at which they were sent, `clock.seconds()`, s."""
        return self._line.write(data)

    def send(self, line: str, limit_seconds: float) -> list[Message]:
        """Send one line, wait for its answer, and return the messages before it; Fault as in `stream`."""
        [sent] = self._submit([line])
        return self._wait(sent, limit_seconds)

    def stream(self, lines: Iterable[str], limit_seconds: float) -> None:
        """Send lines as fast as the buffer of the board takes them, by counting characters, and wait for all answers.

        Lines that fit are sent in one write: lines that belong together, such as light and its end, are not separated
        if this program ends.

        Parameters
        ----------
        limit_seconds : time that a line may take, beside the patience; time while heads are held does not count.

        Raises
        ------
        Fault
            The board rejected a line, did not answer (it is then reset), or is lost. Lines behind that one may be in
            its buffer and would still be executed: the caller must stop the board.
        """
        to_send = deque(lines)
        waiting: deque[Sent] = deque()
        number = 0
        while to_send or waiting:
            if to_send and (not waiting or self._room_for([to_send[0]])):
                together = [to_send.popleft()]
                while to_send and self._room_for([*together, to_send[0]]):
                    together.append(to_send.popleft())
                waiting.extend(self._submit(together))
                continue
            number += 1
            try:
                self._wait(waiting.popleft(), limit_seconds)
            except Fault as fault:
                raise Fault(f"line {number}: {fault}") from None

    def status(self) -> TimedReport:
        """Ask for a report and return it; Fault if none arrives."""
        asked = self.poll.ask()
        patience = self.patience_seconds + LOST_QUERY_SECONDS
        with self.changed:
            while (left := max(asked, self.poll.quiet_until) + patience - clock.seconds()) > 0.0:
                self.refuse_lost()
                latest = self.poll.latest
                if latest is not None and latest.asked >= asked and not self.restarting:
                    return latest
                self.changed.wait(left)
        raise Fault("the board gave no status report")

    def reset(self) -> None:
        """Restart the firmware; Fault if it does not restart: the connection then counts as lost."""
        for _ in range(RESETS):
            with self.changed:
                self.refuse_lost()
                before = self.welcomes
                self._fail_pending("the board was reset")
                self.restarting = True
            self.write(RESET)
            if self.wait_for_welcome(before, self.patience_seconds):
                return
        self.lose("it does not answer, not even to a reset")
        self.refuse_lost()

    def wait_for_welcome(self, before: int, seconds: float) -> bool:
        """Wait for a welcome beyond the number `before`; returns True if it arrived."""
        with self.changed:
            clock.wait_for(self.changed, lambda: self.welcomes > before or self.lost is not None, seconds)
            self.refuse_lost()
            return self.welcomes > before

    def write_past_all(self, data: bytes) -> bool:
        """Send realtime commands even if the write of another thread blocks; returns True if they were sent."""
        return self._line.write_past_all(data)

    def seal(self, why: str | None) -> None:
        """From now on, send only queries, holds and resets; all else fails with `why`. None ends this."""
        self._line.sealed = why

    def let_go(self, why: str = "stopped", wait_seconds: float = -1.0) -> None:
        """Let all lines that wait for an answer fail with `why`, and ignore answers until a reset, which must follow.

        Does nothing if another thread holds the lock for `wait_seconds`; default: no limit.
        """
        if self.changed.acquire(timeout=wait_seconds):
            try:
                self._ending = True
                self._fail_pending(why)
            finally:
                self.changed.release()

    def refuse_lost(self) -> None:
        """Raise a Fault if the connection is lost."""
        if self.lost is not None:
            raise Fault(f"the connection to the board is lost ({self.lost})")

    def lose(self, why: str) -> None:
        """Mark the connection as lost."""
        with self.changed:
            self.lost = self.lost or why
            self.homed = False
            self._fail_pending(f"the connection to the board is lost ({self.lost})")

    def _submit(self, lines: list[str]) -> list[Sent]:
        """Send lines in one write, once the board has room for all of them."""
        for line in lines:
            if len(line) > LONGEST_LINE or "\n" in line:
                expected = f"expected one line of {LONGEST_LINE} characters at most"
                raise RefusedInput("G-code", f"{expected}, found {line[:40]!r}")
        sent = [Sent(line, len(line) + 1) for line in lines]
        with self.changed:
            ready = clock.wait_for(self.changed, lambda: self._can_speak(lines), self.patience_seconds)
            self.refuse_lost()
            if self.deaf and self.alarm is not None:
                raise Fault(alarm_in_words(self.alarm))
            if not ready:
                raise Fault(f"the board did not become ready for {lines[0]}")
            self._pending.extend(sent)
            self.write("".join(f"{line}\n" for line in lines).encode("ascii"))
        return sent

    def _can_speak(self, lines: list[str]) -> bool:
        """True if the board is ready for `lines`, or never will be."""
        ready = not (self.restarting or self._ending) and self._room_for(lines)
        return ready or self.deaf or self.lost is not None

    def _room_for(self, lines: list[str]) -> bool:
        with self.changed:
            return sum(sent.bytes for sent in self._pending) + sum(len(line) + 1 for line in lines) <= RX_BYTES

    def _wait(self, sent: Sent, limit_seconds: float) -> list[Message]:
        left, held = self.patience_seconds + limit_seconds, 0.0
        with self.changed:
            while sent.error is None and sent.failed is None and left > 0.0 and held < LONGEST_HOLD_SECONDS:
                began = clock.seconds()
                self.changed.wait(min(left, 0.1))
                passed = clock.seconds() - began
                latest = self.poll.latest
                if latest is not None and latest.report.state in ("Hold", "Door"):
                    held += passed
                else:
                    left -= passed
            if sent.failed is None and sent.error is None:
                self._distrust(f"the board gave no answer to {sent.line} and was reset")
            if sent.failed is not None:
                raise Fault(sent.failed)
            if sent.error:
                raise Fault(f"the board did not take {sent.line}: {error_in_words(sent.error)}")
            return sent.messages

    def _hear(self, text: str, seconds: float) -> None:
        """Handle a line from the board, in the thread that reads."""
        message = read_line(text)
        timed: TimedReport | None = None
        with self.changed:
            match message:
                case Answer():
                    self._take_answer(message.error)
                case Alarm():
                    self._take_alarm(message.number)
                case Welcome():
                    self._take_welcome(message.version)
                case Report():
                    timed = self.poll.take(message, seconds, len(text) + 2)
                    self.homed = self.homed and message.state != "Alarm"
                case Feedback(kind="MSG", text=words):
                    self.homed = self.homed and words != LOCKED
                case Garbled():
                    self.garbled += 1
                case message if message is not None and self._pending:
                    self._pending[0].messages.append(message)
            self.changed.notify_all()
        if timed is not None and self.on_report is not None:
            self.on_report(timed)

    def _take_answer(self, error: int) -> None:
        if self.restarting or self.deaf or self._ending:
            return  # belongs to a line that an alarm or a reset has ended
        if self._pending:
            self._pending.popleft().error = error
        else:
            self._distrust("the board answered a line that was not sent and was reset")

    def _take_alarm(self, number: int) -> None:
        self.alarm = number
        self.standstills += 1
        self.homed = False
        self.deaf = number in DEAF
        self.restarting = number not in NO_RESTART
        self.poll.forget()
        self._fail_pending(alarm_in_words(number))

    def _take_welcome(self, version: str) -> None:
        self.version = version
        self.welcomes += 1
        self.standstills += 1
        self.restarting = self.deaf = self._ending = False
        self.poll.forget()
        self._fail_pending("the board has restarted")

    def _distrust(self, why: str) -> None:
        """Reset the board, because lines and answers no longer match."""
        self._fail_pending(why)
        self.restarting = True
        self.poll.forget()
        self.write(RESET)

    def _fall_silent(self) -> None:
        """Reset a board that sent no report for too long, in the thread of the poll."""
        if self.deaf:
            return  # it answers nothing but a reset
        try:
            self.reset()
        except Fault:
            return  # the state reports it

    def _fail_pending(self, why: str) -> None:
        with self.changed:
            for sent in self._pending:
                sent.failed = why
            self._pending.clear()
            self.changed.notify_all()
