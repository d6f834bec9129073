"""Lines to the board and what comes back: answers in the order of the lines, alarms, restarts, silence, loss.

A line's answer is the next `ok` or `error:N` that belongs to no line before it. Where that order is broken - an answer
too many, or one that never comes - lines and answers cannot be told apart any longer: the board is reset at once, which
ends motion and light, and every line that waits fails.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from footscan.capture.grbl.codes import alarm_in_words, error_in_words
from footscan.capture.grbl.report import Alarm, Answer, Feedback, Garbled, Message, Report, Welcome, read_line
from footscan.capture.grbl.serial_line import SerialLine
from footscan.capture.grbl.status_poll import LOST_QUERY_SECONDS, StatusPoll, TimedReport
from schemas.base.errors import Fault, RefusedInput

RX_BYTES = 127
"""What the board's receive buffer of 128 bytes holds for certain."""
LONGEST_LINE = 79
CLOSED = "closed"
"""Why a connection is lost that we have ended."""
RESET = b"\x18"
RESETS = 3
"""How often a reset is tried: its byte may be lost."""
LONGEST_HOLD_SECONDS = 600.0
"""How long a travel may be held, or wait for the lid, until it is given up."""
DEAF = (1, 2)
"""Alarms after which the board hears nothing but a reset."""
NO_RESTART = (*DEAF, 4, 5)
"""Alarms that the firmware does not follow with a restart of its own."""
LOCKED = "'$H'|'$X' to unlock"


@dataclass
class Sent:
    """A line that was sent, and its answer."""

    line: str
    bytes: int
    error: int | None = None
    """0 for `ok`; None before the answer."""
    failed: str | None = None
    """Why there will be no answer."""
    said: list[Message] = field(default_factory=list)
    """What the board said while it worked at this line."""


class Conversation:
    """A serial line with a Grbl board behind it. All methods may be called from any thread."""

    def __init__(self, port: str, patience_seconds: float) -> None:
        """Opens `port`; errors as those of `SerialLine`. Nothing can be sent before the first welcome."""
        self.patience_seconds = patience_seconds
        self.on_report: Callable[[TimedReport], None] | None = None
        """Called with each status report, in the thread that reads the line."""
        self.version = ""
        self.garbled = 0
        """Lines that came damaged."""
        self.homed = False
        """Whether the firmware knows where the heads are; an alarm or a restart of the board ends that."""
        self.alarm: int | None = None
        """The latest alarm since the last homing."""
        self.deaf = False
        """Whether the board hears nothing but a reset."""
        self.restarting = True
        """Whether it is about to begin anew."""
        self.lost: str | None = None
        """Why there is no connection any longer."""
        self.welcomes = 0
        self.standstills = 0
        """How often it said welcome or told an alarm: motion and light had ended."""
        self.changed = threading.Condition()
        """Told of everything that is heard."""
        self._ending = False
        """Whether answers mean nothing until the board has begun anew."""
        self._pending: deque[Sent] = deque()
        self._line = SerialLine(port, self._hear, self.lose)
        self.poll = StatusPoll(self.write, self._fall_silent, patience_seconds)
        self._line.start()

    def close(self) -> None:
        """Ends all threads; every line that waits fails."""
        self.poll.close()
        self.lose(CLOSED)
        self._line.close()

    def write(self, data: bytes) -> float:
        """Sends bytes as they are: realtime commands. The time at which they went."""
        return self._line.write(data)

    def send(self, line: str, limit_seconds: float) -> list[Message]:
        """Sends one line, waits for its answer, and returns what the board said before that; Fault as in `stream`."""
        [sent] = self._submit([line])
        return self._wait(sent, limit_seconds)

    def stream(self, lines: Iterable[str], limit_seconds: float) -> None:
        """Sends lines as fast as the board's buffer takes them, counting characters, and waits until all are answered.

        Lines that fit go in one write: what belongs together, as light and its end, is not torn apart by our own end.

        Parameters
        ----------
        limit_seconds : how long a line may take, beside patience. Time in which the heads are held does not count.

        Raises
        ------
        Fault
            The board did not take a line, gave no answer (it is reset then), or is lost. Lines behind that one may be
            in its buffer and would still be executed: the caller has to stop the board.
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
        """A report that was asked for after this call; Fault where none comes."""
        asked = self.poll.ask()
        patience = self.patience_seconds + LOST_QUERY_SECONDS
        with self.changed:
            while (left := max(asked, self.poll.quiet_until) + patience - time.monotonic()) > 0.0:
                self.refuse_lost()
                latest = self.poll.latest
                if latest is not None and latest.asked >= asked and not self.restarting:
                    return latest
                self.changed.wait(left)
        raise Fault("the board gave no status report")

    def reset(self) -> None:
        """Restarts the firmware. Fault where it does not begin anew: the connection counts as lost then."""
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
        """Waits until the board has said welcome more often than `before`; whether it has."""
        with self.changed:
            self.changed.wait_for(lambda: self.welcomes > before or self.lost is not None, seconds)
            self.refuse_lost()
            return self.welcomes > before

    def write_past_all(self, data: bytes) -> bool:
        """Sends realtime commands although another thread's write hangs; whether they went."""
        return self._line.write_past_all(data)

    def seal(self, why: str | None) -> None:
        """From now on nothing goes out but queries, holds and resets, and all else fails with `why`; None ends that."""
        self._line.sealed = why

    def let_go(self, why: str = "stopped", wait_seconds: float = -1.0) -> None:
        """Every line that waits fails and says `why`, and answers mean nothing until a reset, which must follow.

        Gives up where another thread holds on to the conversation for `wait_seconds`; without them it waits.
        """
        if self.changed.acquire(timeout=wait_seconds):
            try:
                self._ending = True
                self._fail_pending(why)
            finally:
                self.changed.release()

    def refuse_lost(self) -> None:
        """Fault where there is no connection."""
        if self.lost is not None:
            raise Fault(f"the connection to the board is lost ({self.lost})")

    def lose(self, why: str) -> None:
        """There is no connection any longer."""
        with self.changed:
            self.lost = self.lost or why
            self.homed = False
            self._fail_pending(f"the connection to the board is lost ({self.lost})")

    def _submit(self, lines: list[str]) -> list[Sent]:
        """Sends lines in one write, when the board has room for all of them."""
        for line in lines:
            if len(line) > LONGEST_LINE or "\n" in line:
                expected = f"expected one line of {LONGEST_LINE} characters at most"
                raise RefusedInput("G-code", f"{expected}, found {line[:40]!r}")
        sent = [Sent(line, len(line) + 1) for line in lines]
        with self.changed:
            ready = self.changed.wait_for(lambda: self._can_speak(lines), self.patience_seconds)
            self.refuse_lost()
            if self.deaf and self.alarm is not None:
                raise Fault(alarm_in_words(self.alarm))
            if not ready:
                raise Fault(f"the board did not become ready for {lines[0]}")
            self._pending.extend(sent)
            self.write("".join(f"{line}\n" for line in lines).encode("ascii"))
        return sent

    def _can_speak(self, lines: list[str]) -> bool:
        """Whether waiting longer makes no difference for sending `lines`."""
        ready = not (self.restarting or self._ending) and self._room_for(lines)
        return ready or self.deaf or self.lost is not None

    def _room_for(self, lines: list[str]) -> bool:
        with self.changed:
            return sum(sent.bytes for sent in self._pending) + sum(len(line) + 1 for line in lines) <= RX_BYTES

    def _wait(self, sent: Sent, limit_seconds: float) -> list[Message]:
        left, held = self.patience_seconds + limit_seconds, 0.0
        with self.changed:
            while sent.error is None and sent.failed is None and left > 0.0 and held < LONGEST_HOLD_SECONDS:
                began = time.monotonic()
                self.changed.wait(min(left, 0.1))
                passed = time.monotonic() - began
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
            return sent.said

    def _hear(self, text: str, seconds: float) -> None:
        """One line from the board, in the thread that reads."""
        message = read_line(text)
        told: TimedReport | None = None
        with self.changed:
            match message:
                case Answer():
                    self._take_answer(message.error)
                case Alarm():
                    self._take_alarm(message.number)
                case Welcome():
                    self._take_welcome(message.version)
                case Report():
                    told = self.poll.take(message, seconds, len(text) + 2)
                    self.homed = self.homed and message.state != "Alarm"
                case Feedback(kind="MSG", text=words):
                    self.homed = self.homed and words != LOCKED
                case Garbled():
                    self.garbled += 1
                case message if message is not None and self._pending:
                    self._pending[0].said.append(message)
            self.changed.notify_all()
        if told is not None and self.on_report is not None:
            self.on_report(told)

    def _take_answer(self, error: int) -> None:
        if self.restarting or self.deaf or self._ending:
            return  # of a line that an alarm or a reset has ended
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
        self._fail_pending("the board has begun anew")

    def _distrust(self, why: str) -> None:
        """Lines and answers no longer belong together: only a reset helps."""
        self._fail_pending(why)
        self.restarting = True
        self.poll.forget()
        self.write(RESET)

    def _fall_silent(self) -> None:
        """No report came for too long, in the thread that asks."""
        if self.deaf:
            return  # silent as it has to be
        try:
            self.reset()
        except Fault:
            return  # the state tells it

    def _fail_pending(self, why: str) -> None:
        with self.changed:
            for sent in self._pending:
                sent.failed = why
            self._pending.clear()
            self.changed.notify_all()
