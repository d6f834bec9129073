"""The last stop of a board: feed hold and soft reset within 0.3 s, ahead of queued lines; nothing is sent after it."""

import threading
import time
from contextlib import suppress

from footscan import clock
from footscan.capture.grbl.protocol import CLOSED, RESET, RESETS, GrblProtocol
from footscan.capture.grbl.report import Report
from schemas.base.errors import Fault

HOLD = b"!"
HALT_SECONDS = 0.22
"""Wait before the reset: heads halt from 100 mm/s in 0.2 s. Heads that still move lose their position."""
WELCOME_SECONDS = 0.1
"""A board restarts within a few ms of a reset; the byte of the reset may be lost."""
LOOKS_SECONDS = 0.01


class LastStop:
    """Stops a board, from a thread that waits for no other."""

    def __init__(self, board: GrblProtocol) -> None:
        self._board = board
        self._stopping = threading.Lock()
        self._confirmed: bool | None = None
        """True if the board confirmed the stop for good; None before it."""

    def __call__(self, *, for_good: bool) -> bool:
        """Halt the heads, then reset the board, which ends the light and discards queued motion.

        Nothing else is sent from the first byte on; after a stop for good, never again.

        Returns
        -------
        confirmed : True if the board has restarted or reported an alarm; False if the connection is lost.
        """
        with self._stopping:
            if self._confirmed is not None:
                return self._confirmed
            if self._board.lost == CLOSED:
                return True
            why = "the program was told to end" if for_good else "the program was suspended"
            self._board.seal(why)
            confirmed = self._halt_and_reset(why)
            if for_good:
                self._confirmed = confirmed
            else:
                self._board.seal(None)
            return confirmed

    def _halt_and_reset(self, why: str) -> bool:
        board = self._board
        if board.poll.rests:  # a board that homes accepts a reset only
            board.let_go(why, LOOKS_SECONDS)
        else:
            held = clock.seconds()
            board.write_past_all(HOLD)
            board.let_go(why, LOOKS_SECONDS)
            self._wait_until_halted(held)
        for _ in range(RESETS):
            before = board.standstills
            if not board.write_past_all(RESET):
                return False
            deadline = clock.seconds() + WELCOME_SECONDS
            while clock.seconds() < deadline:
                if board.standstills > before:
                    return True
                time.sleep(LOOKS_SECONDS)
        return False

    def _wait_until_halted(self, held: float) -> None:
        while clock.seconds() < held + HALT_SECONDS:
            with suppress(Fault):  # the connection is lost
                self._board.poll.ask()
            time.sleep(LOOKS_SECONDS)
            latest = self._board.poll.latest
            if latest is not None and held < latest.asked and not slows_down(latest.report):
                return


def slows_down(report: Report) -> bool:
    """True if heads move that are to halt."""
    return report.state in ("Run", "Jog") or (report.state, report.substate) in (("Hold", 1), ("Door", 2))
