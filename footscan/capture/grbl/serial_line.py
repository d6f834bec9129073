"""The serial line to the board: bytes out, lines in with their time of arrival, and one report of its loss."""

import errno
import os
import threading
from collections.abc import Callable
from termios import error as termios_error

import serial

from footscan import clock
from schemas.base.errors import Fault, RefusedInput

BAUD = 115_200
BYTES_PER_SECOND = BAUD / 10
LOOKS_EVERY_SECONDS = 0.2
"""Limit of a read; the thread of a closed line ends within this time."""
WRITE_SECONDS = 1.0
PAST_ALL_SECONDS = 0.02
"""Limit of the wait of the last stop for the write of another thread, which usually takes no time."""
HARMLESS = (b"?", b"!", b"\x18")
"""Query, feed hold and reset: they move and light nothing."""
GONE = (errno.EIO, errno.ENODEV, errno.ENXIO, errno.EBADF)
"""Error numbers of a port whose cable was pulled."""
LONGEST_LINE = 400
"""Longer than all lines of Grbl: a longer one is noise."""


class SerialLine:
    """An open port with a thread that reads it, from `start` to `close`."""

    def __init__(self, port: str, on_line: Callable[[str, float], None], on_lost: Callable[[str], None]) -> None:
        """Open `port`.

        Parameters
        ----------
        port : name of the serial port, preferably a stable one (/dev/serial/by-id/...).
        on_line : called in the reading thread with each line, without its end, and the time of its last byte.
        on_lost : called once, in any thread, with the reason of the loss.

        Raises
        ------
        RefusedInput
            There is no such port, or it may not be opened.
        Fault
            Another program has it open.
        """
        self._on_line = on_line
        self._on_lost = on_lost
        self._open = True
        self.sealed: str | None = None
        """Reason why only commands that stop the board are sent; None if all are."""
        self._writing = threading.Lock()
        self._losing = threading.Lock()
        self._port = _opened(port)
        self._thread = threading.Thread(target=self._read, name=f"serial line {port}", daemon=True)

    def start(self) -> None:
        """Start reading."""
        self._thread.start()

    def write(self, data: bytes) -> float:
        """Send `data`; returns the time of sending, `clock.seconds()`. Fault if the line is lost."""
        try:
            with self._writing:
                if not self._open:
                    raise Fault("the connection to the board is closed")
                if self.sealed is not None and data not in HARMLESS:
                    raise Fault(self.sealed)
                seconds = clock.seconds()
                self._port.write(data)
                return seconds
        except (OSError, termios_error) as error:  # SerialException is an OSError
            self._lose(error)
            raise Fault(f"the connection to the board is lost ({_reason(error)})") from None

    def write_past_all(self, data: bytes) -> bool:
        """Send a realtime command even if the write of another thread blocks; returns True if it was sent.

        It may go between the bytes of a line.
        """
        waited = self._writing.acquire(timeout=PAST_ALL_SECONDS)
        try:
            return self._open and os.write(self._port.fileno(), data) == len(data)
        except (OSError, termios_error, TypeError):  # pyserial's own state is gone when closed under it
            return False
        finally:
            if waited:
                self._writing.release()

    def close(self) -> None:
        """End the thread and close the port."""
        self._open = False
        if hasattr(self._port, "cancel_read"):  # where the system has it, a read need not time out first
            self._port.cancel_read()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()
        self._port.close()

    def _read(self) -> None:
        waiting = bytearray()
        while self._open:
            try:
                data = self._port.read(max(self._port.in_waiting, 1))
            except (OSError, termios_error, TypeError) as error:  # pyserial's own state is gone when closed under it
                self._lose(error)
                return
            seconds = clock.seconds()
            waiting += data
            *lines, rest = waiting.split(b"\n")
            waiting = bytearray(rest[-LONGEST_LINE:])
            for line in lines:
                self._on_line(line.rstrip(b"\r").decode("ascii", errors="replace"), seconds)

    def _lose(self, error: BaseException) -> None:
        with self._losing:
            was_open, self._open = self._open, False
        if was_open:
            self._on_lost(_reason(error))


def _opened(port: str) -> serial.Serial:
    try:
        return serial.Serial(port, BAUD, timeout=LOOKS_EVERY_SECONDS, write_timeout=WRITE_SECONDS, exclusive=True)
    except (OSError, ValueError, termios_error) as error:
        if isinstance(error, OSError) and "exclusively lock" in str(error):
            raise Fault(f"{port}: another program is using this port") from None
        why = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else _reason(error)
        raise RefusedInput(port, f"cannot be opened ({why}), expected the serial port of a Grbl board") from None


def _reason(error: BaseException) -> str:
    gone = isinstance(error, TypeError) or "returned no data" in str(error)
    if gone or (isinstance(error, OSError) and error.errno in GONE):
        return "unplugged"
    return str(error) or type(error).__name__
