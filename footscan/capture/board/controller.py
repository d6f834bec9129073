"""Controls one Grbl 1.1 board on a serial port: settings, homing, jogs, holds, lines of G-code, state and termination.

However the program ends, the host switches the lasers off as far as it can; docs/scanner_controller.md lists what the
board does on its own. Positions are machine positions; `heads` converts them to world coordinates.
"""

import atexit
import threading
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Self

from footscan import clock
from footscan.capture.board.emergency_stop import HOLD, LastStop, slows_down
from footscan.capture.board.state import BoardState, state_from
from footscan.capture.board.termination import BOARDS
from footscan.capture.grbl.codes import alarm_in_words
from footscan.capture.grbl.protocol import GrblProtocol
from footscan.capture.grbl.report import Feedback, Message, Setting
from footscan.capture.grbl.settings import SAME, check_settings, setting_line, setup_lines
from footscan.capture.grbl.status_poll import TimedReport
from schemas.base.errors import Fault, RefusedInput
from schemas.rig import RigBoard

RESUME, DOOR, JOG_CANCEL, RESET = b"~", b"\x84", b"\x85", b"\x18"
OVERRIDES_AWAY = b"\x90\x95\x99"
"""Feed, rapids and power as programmed: a disturbed byte may have changed them."""
CONNECT_SECONDS = 8.0
"""Limit of the wait for a board; one that restarts when its port is opened answers after about two seconds."""
ASKS_EVERY_SECONDS = 1.0
TRIES = 3
DARK_BY_ITSELF = "light goes out at the end of the motion under way at latest; switch off the board's power to be sure"


class Controller:
    """The board behind a serial port. All methods may be called from any thread."""

    def __init__(self, port: str, setup: RigBoard | None = None, *, patience_seconds: float = 2.0) -> None:
        """Open the port and reset the board, so that its lasers are off and its state is known.

        Parameters
        ----------
        port : name of the serial port, preferably a stable one (/dev/serial/by-id/...).
        setup : settings that the board must have; None accepts any.
        patience_seconds : limit of the wait for answers that take the board no time.

        Raises
        ------
        RefusedInput
            There is no such port, no Grbl 1.1 answers, or a setting is wrong.
        Fault
            The port is in use, the lid is open, or the line is disturbed.
        """
        self.port = port
        self.options = ""
        """Letters of the build options of the firmware: V for a variable spindle, + for an input of a lid or door."""
        self._closing = threading.Lock()
        self._closed = False
        self._board = GrblProtocol(port, patience_seconds)
        self._last_stop = LastStop(self._board)
        atexit.register(self.close)
        try:
            BOARDS.enlist(self._last_stop)
            self._connect()
            if setup is not None:
                self.check(setup)
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
        """The present state, at most 0.2 s old."""
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
                return BoardState("restarting", "the board restarts")
            return state_from(latest.report, homed=board.homed, alarm=board.alarm)

    @property
    def version(self) -> str:
        """Version of the firmware."""
        return self._board.version

    @property
    def homed(self) -> bool:
        """True if the firmware knows where the heads are."""
        return self._board.homed

    @property
    def garbled(self) -> int:
        """Number of damaged lines that arrived: a sign of a bad cable."""
        return self._board.garbled

    @property
    def watches_door(self) -> bool:
        """True if the firmware has an input for a lid or door; without one, nothing stops when it is opened."""
        return "+" in self.options

    @property
    def round_trip_seconds(self) -> float:
        """Median time between the latest queries and their answers; NaN before the first answer."""
        return self._board.poll.round_trip_seconds

    def on_report(self, take: Callable[[TimedReport], None]) -> None:
        """Call `take` with each status report from now on, in the thread that reads the line."""
        self._board.on_report = take

    def settings(self) -> dict[int, float]:
        """Read all settings of the board, by number."""
        return {message.number: message.value for message in self.send("$$") if isinstance(message, Setting)}

    def check(self, setup: RigBoard) -> None:
        """Refuse a board with other settings; the error names the first wrong one and the line to send."""
        source = f"board at {self.port}"
        try:
            check_settings(self.settings(), setup, source)
        except RefusedInput:
            check_settings(self.settings(), setup, source)  # read again: a byte may have been lost on the line

    def apply(self, setup: RigBoard) -> list[str]:
        """Write the settings that differ, read all back, and return the lines that were sent; then home the heads."""
        present = self.settings()
        different = [line for line in setup_lines(setup) if not _holds(line, present)]
        for line in different:
            self._board.homed = False
            self.send(line)
        self.check(setup)
        return different

    def change(self, number: int, value: float) -> None:
        """Write one setting into the EEPROM of the board, which endures about 100,000 writes."""
        self.send(setting_line(number, value))

    def home(self, limit_seconds: float) -> None:
        """Reset the board and run the homing cycle; each head then stands at the pull-off distance from its switch.

        This recovers from every alarm and every disturbance: the reset discards what is left of damaged lines.

        Raises
        ------
        Fault
            Homing failed, with the alarm and the end switches that are pressed; or it took longer than `limit_seconds`.
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
        """Treat the heads as not homed, because they are not where the firmware counts them."""
        self._board.homed = False

    def unlock(self) -> None:
        """Allow jogs although the heads are not homed; soft limits have no meaning then."""
        if self._board.deaf:
            self.reset()
        self.send("$X")

    def send(self, line: str, *, limit_seconds: float = 0.0) -> list[Message]:
        """Send one line, wait for its answer, and return the messages that arrived before it.

        Parameters
        ----------
        limit_seconds : time that the line may take, beside the patience; time while heads are held does not count.

        Raises
        ------
        Fault
            The board rejected the line, did not answer in time (it is then reset), or is lost.
        """
        return self._board.send(line, limit_seconds)

    def stream(self, lines: Iterable[str], *, limit_seconds: float) -> None:
        """Send lines by character counting, as Grbl calls it, and wait for all answers.

        Answers arrive in the order of the lines, so an error names its line. The board would still execute the lines
        behind it in its buffer: heads and lasers are stopped before any error is raised.
        """
        try:
            self._board.stream(lines, limit_seconds)
        except BaseException:
            self._stop_quietly()
            raise

    def status(self) -> TimedReport:
        """Ask for a report and return it."""
        return self._board.status()

    def jog(self, by_mm: tuple[float, float, float], mm_per_s: float) -> None:
        """Begin to move the heads by `by_mm` along their axes, the farthest one at `mm_per_s`; jogs are queued."""
        words = "".join(f"{axis}{by:.3f}" for axis, by in zip("XYZ", by_mm, strict=True) if by)
        length = sum(by * by for by in by_mm) ** 0.5
        if words:
            feed = 60.0 * mm_per_s * length / max(abs(by) for by in by_mm)
            self.send(f"$J=G21G91{words}F{feed:.1f}")

    def cancel_jog(self) -> None:
        """End all jogs; the heads slow down first."""
        self._board.write(JOG_CANCEL)

    def hold(self) -> None:
        """Slow the heads down to a halt; the light goes out when they stand. `resume` continues."""
        self._board.write(HOLD)

    def resume(self) -> None:
        """Continue after a hold, or after the lid was closed; while it is open, the heads stay held."""
        self._board.write(RESUME)

    def door(self) -> None:
        """Act as when the lid is opened."""
        self._board.write(DOOR)

    def overrides_away(self) -> None:
        """Reset overrides of speed and power, which a disturbed byte may have changed."""
        self._board.write(OVERRIDES_AWAY)

    def stop(self) -> None:
        """Stop heads and lasers: the heads slow down, the light goes out, and queued motion is discarded.

        The position is kept if the heads can slow down in time; the board is reset in any case.
        """
        homing = self._board.poll.rests  # while it homes, the board answers nothing and has no position to keep
        self._board.let_go()
        try:
            if not homing:
                self._slow_down()
        finally:
            self.reset()

    def reset(self) -> None:
        """Restart the firmware: light and motion end at once; during motion the position is lost.

        Raises
        ------
        Fault
            The board does not answer. Only its power switch is reliable then.
        """
        self._board.reset()
        self.status()

    def close(self) -> None:
        """Stop heads and lasers and close the port; may be called again."""
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
        """Reset the board until it sends its welcome, then check its firmware.

        Two welcomes may arrive: one after the restart when the port is opened, and one after our reset.
        """
        deadline = clock.seconds() + CONNECT_SECONDS
        welcome = self._board.wait_for_welcome(0, 0.1)
        while not welcome and clock.seconds() < deadline:
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
        feedback = [message for message in self._build_info() if isinstance(message, Feedback)]
        options = [message.text for message in feedback if message.kind == "OPT"]
        self.options = options[0].split(",")[0] if options else ""

    def _build_info(self) -> list[Message]:
        for _ in range(TRIES - 1):
            try:
                return self.send("$I")
            except Fault:
                continue
        return self.send("$I")

    def _switches(self) -> str:
        """Text with the end switches that are pressed; empty if the board does not report."""
        try:
            pins = self.status().report.pins
        except Fault:
            return ""
        pressed = ", ".join(f"head {head}" for head, axis in enumerate("XYZ", start=1) if axis in pins)
        return f" (end switches pressed: {pressed or 'none'})"

    def _slow_down(self) -> None:
        """Slow the heads down to a halt, for as long as the patience allows."""
        report = self.status().report
        if report.state in ("Run", "Jog"):
            self.hold()
        deadline = clock.seconds() + self._board.patience_seconds
        while slows_down(report) and clock.seconds() < deadline:
            report = self.status().report

    def _stop_quietly(self) -> None:
        """Stop; if this fails too, the state reports it, and the error under way is the more telling one."""
        try:
            self.stop()
        except Fault:
            return


def _holds(line: str, present: dict[int, float]) -> bool:
    """True if the board already has the setting that `line` would write."""
    number, _, value = line[1:].partition("=")
    present_value = present.get(int(number))
    return present_value is not None and abs(present_value - float(value)) < SAME
