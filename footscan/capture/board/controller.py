"""One Grbl 1.1 board on a serial port: settings, homing, jogs, holds, streams of lines, its state, and the way out.

Every way out ends with the lasers off as far as a host can see to that; docs/scanner_controller.md says what the board
sees to on its own. Positions here are the machine's; `heads` makes world coordinates of them.
"""

import atexit
import threading
import time
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Self

from footscan.capture.board.emergency_stop import HOLD, LastStop, slows_down
from footscan.capture.board.state import BoardState, state_from
from footscan.capture.board.termination import BOARDS
from footscan.capture.grbl.codes import alarm_in_words
from footscan.capture.grbl.protocol import Conversation
from footscan.capture.grbl.report import Feedback, Message, Setting
from footscan.capture.grbl.settings import SAME, BoardSettings, setting_line
from footscan.capture.grbl.status_poll import TimedReport
from schemas.base.errors import Fault, RefusedInput

RESUME, DOOR, JOG_CANCEL, RESET = b"~", b"\x84", b"\x85", b"\x18"
OVERRIDES_AWAY = b"\x90\x95\x99"
"""Feed, rapids and power as programmed: a disturbed byte may have changed them."""
CONNECT_SECONDS = 8.0
"""A board that its port's opening restarts takes about two seconds to speak."""
ASKS_EVERY_SECONDS = 1.0
TRIES = 3
DARK_BY_ITSELF = "light goes out at the end of the motion under way at latest; switch off the board's power to be sure"


class Controller:
    """The board behind a serial port. All methods may be called from any thread."""

    def __init__(self, port: str, settings: BoardSettings | None = None, *, patience_seconds: float = 2.0) -> None:
        """Opens the port and resets the board, so that its lasers are off and its state is known.

        Parameters
        ----------
        port : name of the serial port, best a stable one (/dev/serial/by-id/...).
        settings : what the board must be set to; None takes it as it is.
        patience_seconds : how long the board may take to answer what takes it no time.

        Raises
        ------
        RefusedInput
            No such port, no Grbl 1.1 behind it, or a setting that is not as it must be.
        Fault
            The port is in use, the lid is open, or the line is disturbed.
        """
        self.port = port
        self.options = ""
        """Letters of the firmware's build: V variable spindle, + an input for a lid or door."""
        self._closing = threading.Lock()
        self._closed = False
        self._board = Conversation(port, patience_seconds)
        self._last_stop = LastStop(self._board)
        atexit.register(self.close)
        try:
            BOARDS.enlist(self._last_stop)
            self._connect()
            if settings is not None:
                self.check(settings)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    @property
    def state(self) -> BoardState:
        """What is known now, at most a fifth of a second old."""
        board = self._board
        with board.changed:
            latest = board.poll.latest
            if self._closed:
                return BoardState("closed", "the board is not connected")
            if board.lost is not None:
                return BoardState("lost", f"the connection to the board is lost ({board.lost})", DARK_BY_ITSELF)
            if board.deaf and board.alarm is not None:
                return BoardState("alarm", alarm_in_words(board.alarm))
            if board.poll.rests:
                return BoardState("homing", "the heads look for their home switches")
            if board.restarting or latest is None:
                return BoardState("restarting", "the board begins anew")
            return state_from(latest.report, homed=board.homed, alarm=board.alarm)

    @property
    def version(self) -> str:
        """Of the firmware."""
        return self._board.version

    @property
    def homed(self) -> bool:
        """Whether the firmware knows where the heads are, as far as it can know."""
        return self._board.homed

    @property
    def garbled(self) -> int:
        """How many lines came damaged: a sign of a bad cable."""
        return self._board.garbled

    @property
    def watches_door(self) -> bool:
        """Whether the firmware has an input for a lid or door; where it has none, nothing stops when it is opened."""
        return "+" in self.options

    @property
    def round_trip_seconds(self) -> float:
        """Median time between query and answer lately; NaN before the first."""
        return self._board.poll.round_trip_seconds

    def on_report(self, heard: Callable[[TimedReport], None]) -> None:
        """Calls `heard` with each status report from now on, in the thread that reads the line."""
        self._board.on_report = heard

    def settings(self) -> dict[int, float]:
        """All settings of the board, by number."""
        return {said.number: said.value for said in self.send("$$") if isinstance(said, Setting)}

    def check(self, settings: BoardSettings) -> None:
        """Refuses a board whose settings are not these; names the first wrong one and the line to send."""
        source = f"board at {self.port}"
        try:
            settings.check(self.settings(), source)
        except RefusedInput:
            settings.check(self.settings(), source)  # read again: a byte may have been lost on the line

    def apply(self, settings: BoardSettings) -> list[str]:
        """Writes what differs, reads all back, and returns the lines that were sent. Heads must be homed afterwards."""
        found = self.settings()
        different = [line for line in settings.lines() if not _holds(line, found)]
        for line in different:
            self._board.homed = False
            self.send(line)
        self.check(settings)
        return different

    def change(self, number: int, value: float) -> None:
        """Writes one setting into the board's memory, which bears about 100,000 writes."""
        self.send(setting_line(number, value))

    def home(self, limit_seconds: float) -> None:
        """Resets the board and runs the homing cycle; afterwards each head stands pulled off its home switch.

        This is the way back from every alarm and every disturbance: the reset forgets what is left of damaged lines.

        Raises
        ------
        Fault
            It failed: which alarm, and which end switches are pressed. Or it took longer than `limit_seconds`.
        """
        board = self._board
        self.reset()
        board.homed = False
        try:
            with board.poll.resting():
                self.send("$H", limit_seconds=limit_seconds)
        except Fault as fault:
            raise Fault(f"{fault}{self._switches()}") from None
        with board.changed:
            board.alarm = None
            board.homed = True
        self.status()

    def doubt_home(self) -> None:
        """From now on the heads count as not homed: something shows that they are not where the firmware believes."""
        self._board.homed = False

    def unlock(self) -> None:
        """Allows motion although the heads are not homed, for jogs: soft limits mean nothing then."""
        if self._board.deaf:
            self.reset()
        self.send("$X")

    def send(self, line: str, *, limit_seconds: float = 0.0) -> list[Message]:
        """Sends one line, waits for its answer, and returns what the board said before it.

        Parameters
        ----------
        limit_seconds : how long it may take, beside patience. Time in which the heads are held does not count.

        Raises
        ------
        Fault
            The board did not take the line, gave no answer in time (it is reset then), or is lost.
        """
        return self._board.send(line, limit_seconds)

    def stream(self, lines: Iterable[str], *, limit_seconds: float) -> None:
        """Sends lines by counted characters and waits until all are answered.

        The answers come in the order of the lines, so an error is told with its own line. What stands behind it in the
        board's buffer would still be executed: everything is stopped before the error is raised, whatever it is.
        """
        try:
            self._board.stream(lines, limit_seconds)
        except BaseException:
            self._stop_quietly()
            raise

    def status(self) -> TimedReport:
        """A report that was asked for after this call."""
        return self._board.status()

    def jog(self, by_mm: tuple[float, float, float], mm_per_s: float) -> None:
        """Begins to move heads by so much along their axes, the farthest at that speed; jogs queue up."""
        words = "".join(f"{axis}{by:.3f}" for axis, by in zip("XYZ", by_mm, strict=True) if by)
        length = sum(by * by for by in by_mm) ** 0.5
        if words:
            feed = 60.0 * mm_per_s * length / max(abs(by) for by in by_mm)
            self.send(f"$J=G21G91{words}F{feed:.1f}")

    def cancel_jog(self) -> None:
        """Ends all jogs, slowing down."""
        self._board.write(JOG_CANCEL)

    def hold(self) -> None:
        """Halts the heads, slowing down; the light goes out when they stand. `resume` goes on."""
        self._board.write(HOLD)

    def resume(self) -> None:
        """Goes on after a hold, or after the lid was closed; an open lid holds on."""
        self._board.write(RESUME)

    def door(self) -> None:
        """Does what an open lid does."""
        self._board.write(DOOR)

    def overrides_away(self) -> None:
        """Speed and power as programmed, whatever was changed by hand or by a disturbed byte."""
        self._board.write(OVERRIDES_AWAY)

    def stop(self) -> None:
        """Ends everything: heads slow down, the light goes out, all that was queued is forgotten.

        The position is kept where the heads can slow down in time; the board is reset in any case.
        """
        homing = self._board.poll.rests  # it says nothing meanwhile, and has no position to be kept
        self._board.let_go()
        try:
            if not homing:
                self._slow_down()
        finally:
            self.reset()

    def reset(self) -> None:
        """Restarts the firmware: light and motion end at once; a motion under way costs the position.

        Raises
        ------
        Fault
            The board does not answer. Nothing but its power switch can be relied on then.
        """
        self._board.reset()
        self.status()

    def close(self) -> None:
        """Stops heads and lasers and closes the port; may be called again."""
        with self._closing:
            if self._closed:
                return
            atexit.unregister(self.close)
            try:
                if self._board.lost is None and self._board.welcomes:
                    self._stop_quietly()
            finally:
                BOARDS.dismiss(self._last_stop)
                self._closed = True
                self._board.close()

    def _connect(self) -> None:
        """Resets until the board has said welcome, then asks what it is.

        A second welcome may follow the first, one for the restart that opening the port makes and one for our reset.
        """
        deadline = time.monotonic() + CONNECT_SECONDS
        welcome = self._board.wait_for_welcome(0, 0.1)
        while not welcome and time.monotonic() < deadline:
            self._board.write(RESET)
            welcome = self._board.wait_for_welcome(0, ASKS_EVERY_SECONDS)
        if not welcome:
            raise RefusedInput(self.port, "nothing there speaks as Grbl does, expected a board with Grbl 1.1")
        if not self.version.startswith("1.1"):
            raise RefusedInput(self.port, f"a board with Grbl {self.version}, expected Grbl 1.1")
        self._board.write(RESET)
        self._board.poll.start()
        if self.status().report.state == "Door":
            raise Fault(f"board at {self.port}: {self.state}")
        said = self._build()
        options = [one.text for one in said if isinstance(one, Feedback) and one.kind == "OPT"]
        self.options = options[0].split(",")[0] if options else ""

    def _build(self) -> list[Message]:
        for _ in range(TRIES - 1):
            try:
                return self.send("$I")
            except Fault:
                continue
        return self.send("$I")

    def _switches(self) -> str:
        """Which end switches are pressed, for who has to look at them."""
        try:
            pins = self.status().report.pins
        except Fault:
            return ""
        pressed = ", ".join(f"head {head}" for head, axis in enumerate("XYZ", start=1) if axis in pins)
        return f" (end switches pressed: {pressed or 'none'})"

    def _slow_down(self) -> None:
        """Brings the heads to a halt, as far as that takes no longer than patience."""
        report = self.status().report
        if report.state in ("Run", "Jog"):
            self.hold()
        deadline = time.monotonic() + self._board.patience_seconds
        while slows_down(report) and time.monotonic() < deadline:
            report = self.status().report

    def _stop_quietly(self) -> None:
        """Stops; where even that fails, the state tells it, and the error under way says more."""
        try:
            self.stop()
        except Fault:
            return


def _holds(line: str, found: dict[int, float]) -> bool:
    """Whether the board has the setting that `line` would write."""
    number, _, value = line[1:].partition("=")
    is_there = found.get(int(number))
    return is_there is not None and abs(is_there - float(value)) < SAME
