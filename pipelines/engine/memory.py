"""What this machine remembers of a store, so that what has not been touched is not read again.

It can be lost: then rows and blobs are read, and checked, once more.
"""

import contextlib
import logging
import sqlite3
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

log = logging.getLogger("footscan.store")

_TABLE = """
CREATE TABLE IF NOT EXISTS known (key TEXT PRIMARY KEY, row TEXT, digest TEXT, kind TEXT, problem TEXT, blob TEXT)
"""
_SELECT = "SELECT row, digest, kind, problem, blob FROM known WHERE key = ?"


class Known(NamedTuple):
    """A row that was read, and a blob whose digest was right, with the states that their files had."""

    row: str
    digest: str | None
    kind: str | None
    """Of a failure, as `problem`."""
    problem: str | None
    blob: str | None


@dataclass
class Memory:
    """Rows of one store, by key, in a file of this machine."""

    file: Path
    _new: dict[str, Known] = field(default_factory=dict)
    _connection: sqlite3.Connection | None = None
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def get(self, key: str) -> Known | None:
        """What is remembered of an action."""
        new = self._new.get(key)
        if new is not None:
            return new
        with self._lock:
            if self._connection is None:
                if not self.file.exists():
                    return None
                self._connection = self._open()
            try:
                found = self._connection.execute(_SELECT, (key,)).fetchone()
            except sqlite3.Error:
                self._forget()
                return None
        return None if found is None else Known(*found)

    def put(self, key: str, known: Known) -> None:
        """Remember; on disk with the next `save`."""
        self._new[key] = known

    def save(self) -> None:
        """Write down what is new. A memory that cannot be written is done without."""
        if not self._new:
            return
        with self._lock, contextlib.suppress(OSError):
            rows = [(key, *known) for key, known in list(self._new.items())]
            try:
                self.file.parent.mkdir(parents=True, exist_ok=True)
                self._connection = self._connection or self._open()
                with self._connection:
                    self._connection.execute(_TABLE)
                    self._connection.executemany("INSERT OR REPLACE INTO known VALUES (?, ?, ?, ?, ?, ?)", rows)
                for key, *_ in rows:
                    self._new.pop(key, None)
            except sqlite3.Error as error:
                log.debug("%s: %s", self.file, error)
                self._forget()

    def close(self) -> None:
        """Write down what is new, and let go of the file."""
        self.save()
        with self._lock:
            if self._connection is not None:
                self._connection.close()
                self._connection = None

    def _open(self) -> sqlite3.Connection:
        connection = sqlite3.connect(self.file, timeout=5, check_same_thread=False)
        with contextlib.suppress(sqlite3.Error):
            connection.execute(_TABLE)
        return connection

    def _forget(self) -> None:
        """A damaged memory is of no use; a busy one is another run's, and stays."""
        if self._connection is not None:
            with contextlib.suppress(sqlite3.Error):
                self._connection.close()
            self._connection = None
        try:
            probe = sqlite3.connect(self.file, timeout=5)
            probe.execute("SELECT count(*) FROM known").fetchone()
            probe.close()
        except sqlite3.OperationalError:
            return
        except sqlite3.Error:
            log.warning("%s: damaged, made anew", self.file)
            with contextlib.suppress(OSError):
                self.file.unlink()
