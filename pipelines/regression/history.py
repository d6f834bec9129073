"""The history of a suite: a file of JSON lines that only grows, and stays whole whatever befalls a night."""

import fcntl
import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path

from pydantic import ValidationError

from schemas.base.errors import Fault
from schemas.base.model import canonical_json
from schemas.regression import NightBegun, NightEnded

FILE, LOCK = "history.jsonl", "night.lock"


@dataclass(frozen=True)
class History:
    """The nights of a suite, in the order in which their lines were written."""

    begun: list[NightBegun] = field(default_factory=list)
    ended: list[NightEnded] = field(default_factory=list)
    damaged: list[int] = field(default_factory=list)
    """Numbers of lines that cannot be read; nothing else is lost with them."""

    @property
    def unfinished(self) -> list[NightBegun]:
        """Nights that have begun and not ended: killed, or under way."""
        ended = {night.night for night in self.ended}
        return [night for night in self.begun if night.night not in ended]


def read_history(folder: Path) -> History:
    """What is known of the nights in a folder."""
    history = History()
    try:
        lines = (folder / FILE).read_bytes().split(b"\n")
    except FileNotFoundError:
        return history
    except OSError as error:
        raise Fault(f"{folder / FILE}: cannot be read ({error.strerror or error})") from None
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            value = json.loads(line)
            if value["event"] == "begun":
                history.begun.append(NightBegun.model_validate(value))
            else:
                history.ended.append(NightEnded.model_validate(value))
        except (ValueError, KeyError, TypeError, RecursionError, ValidationError):
            history.damaged.append(number)
    return history


def append(folder: Path, line: NightBegun | NightEnded) -> None:
    """Add a line as a whole or not at all.

    Others that append wait for each other. A last line that was torn by a killed process is closed first, so that it
    spoils no other. Where the disk takes but a part of the line, that part is taken away again.

    Raises
    ------
    Fault
        The disk refuses; the file is as it was.
    """
    data = canonical_json(line.model_dump(mode="json")).encode() + b"\n"
    path = folder / FILE
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            _append(descriptor, data)
        finally:
            os.close(descriptor)
    except OSError as error:
        raise Fault(f"{path}: cannot be written ({error.strerror or error})") from None


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """One night at a time: held while it lasts, and let go by the system however it ends.

    Raises
    ------
    Fault
        Another one is under way.
    """
    path = folder / LOCK
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = path.open("a+", encoding="ascii")
    except OSError as error:
        raise Fault(f"{path}: cannot be written ({error.strerror or error})") from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise Fault(f"{folder}: another night is under way there, expected one at a time") from None
        yield


def gaps(history: History, every: timedelta) -> list[tuple[datetime, datetime]]:
    """Ends of nights that follow each other so late that one between them did not run."""
    ends = sorted(night.time for night in history.ended)
    return [(one, other) for one, other in pairwise(ends) if other - one > 1.5 * every]


def _append(descriptor: int, data: bytes) -> None:
    size = os.fstat(descriptor).st_size
    if size and os.pread(descriptor, 1, size - 1) != b"\n":
        data = b"\n" + data
    written = 0
    try:
        while written < len(data):
            written += os.write(descriptor, data[written:])
        os.fsync(descriptor)
    except OSError:
        os.ftruncate(descriptor, size)
        raise


def night_name() -> str:
    """The name of a night that begins now; two that begin at once have different ones."""
    return f"{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime())}-{os.urandom(4).hex()}"
