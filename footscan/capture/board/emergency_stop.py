"""The last stop of a board: feed hold and soft reset within 0.3 s, past all that waits, and nothing sent after it."""

import threading
import time
from contextlib import suppress

from footscan.capture.grbl.protocol import CLOSED, RESET, RESETS, Conversation
from footscan.capture.grbl.report import Report
from schemas.base.errors import Fault

HOLD = b"!"
HALT_SECONDS = 0.22
"""Heads halt from 100 mm/s in 0.2 s. Those that still move then lose their position by the reset."""
WELCOME_SECONDS = 0.1
"""A board begins anew within a few ms of a reset; its byte may be lost."""
LOOKS_SECONDS = 0.01


class LastStop:
    """Stops the board of a conversation from a thread that may wait for no other."""

    def __init__(self, board: Conversation) -> None:
        self._board = board
        self._stopping = threading.Lock()
        self._confirmed: bool | None = None
        """Whether the stop for good was confirmed; None before it."""

    def __call__(self, *, for_good: bool) -> bool:
        """Halts the heads, then resets the board, which ends light and all that was queued.

        Nothing else goes out from the first byte on; after a stop for good, never again.

        Returns
        -------
        confirmed : whether the board has begun anew, or told an alarm. One whose connection is lost has not.
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
        if board.poll.rests:  # a board that homes hears a reset only
            board.let_go(why, LOOKS_SECONDS)
        else:
            held = time.monotonic()
            board.write_past_all(HOLD)
            board.let_go(why, LOOKS_SECONDS)
            self._wait_until_halted(held)
        for _ in range(RESETS):
            before = board.standstills
            if not board.write_past_all(RESET):
                return False
            deadline = time.monotonic() + WELCOME_SECONDS
            while time.monotonic() < deadline:
                if board.standstills > before:
                    return True
                time.sleep(LOOKS_SECONDS)
        return False

    def _wait_until_halted(self, held: float) -> None:
        while time.monotonic() < held + HALT_SECONDS:
            with suppress(Fault):  # the connection is lost
                self._board.poll.ask()
            time.sleep(LOOKS_SECONDS)
            latest = self._board.poll.latest
            if latest is not None and held < latest.asked and not slows_down(latest.report):
                return


def slows_down(report: Report) -> bool:
    """Whether heads move that are to come to a halt."""
    return report.state in ("Run", "Jog") or (report.state, report.substate) in (("Hold", 1), ("Door", 2))
