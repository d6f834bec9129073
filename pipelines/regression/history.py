"""The history of a suite: a file of JSON lines that only grows, and stays intact if a night is killed."""

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
GAP = 1.5
"""Time between two nights, in intervals, above which a night between them is missing; chosen by hand."""


@dataclass(frozen=True)
class History:
    """The nights of a suite, in the order in which their lines were written."""

    begun: list[NightBegun] = field(default_factory=list)
    ended: list[NightEnded] = field(default_factory=list)
    damaged: list[int] = field(default_factory=list)
    """Numbers of the lines that cannot be read; all other lines are used."""

    @property
    def unfinished(self) -> list[NightBegun]:
        """Nights that have begun but not ended: killed, or still running."""
        ended = {night.night for night in self.ended}
        return [night for night in self.begun if night.night not in ended]


def read_history(folder: Path) -> History:
    """Read the history of the nights in a folder; empty without a history. Fault if it cannot be read."""
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
    """Append a line as a whole or not at all.

    Concurrent writers wait for each other. A last line that a killed process left incomplete is ended first, so that it
    does not spoil the new one. If the disk takes only a part of the line, that part is removed again.

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
    """Hold the lock of a night until the block ends; the system releases it if the process dies.

    Raises
    ------
    Fault
        Another night holds it.
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


def gaps(history: History, interval: timedelta) -> list[tuple[datetime, datetime]]:
    """Ends of successive nights between which a night is missing; one is expected every `interval`."""
    ends = sorted(night.time for night in history.ended)
    return [(before, after) for before, after in pairwise(ends) if after - before > GAP * interval]


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
    """A name for a night that begins now; it is unique even if two nights begin at once."""
    return f"{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime())}-{os.urandom(4).hex()}"
