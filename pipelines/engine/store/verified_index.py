"""What this machine remembers of a store, so that what has not been touched is not read again.

It can be lost: then rows and blobs are read, and checked, once more.
"""

import contextlib
import hashlib
import logging
import os
import sqlite3
import threading
import zlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

log = logging.getLogger("footscan.store")

_TABLE = """
CREATE TABLE IF NOT EXISTS known
(key TEXT PRIMARY KEY, row TEXT, digest TEXT, kind TEXT, problem TEXT, blob TEXT, seal INTEGER) WITHOUT ROWID
"""
_SELECT = "SELECT row, digest, kind, problem, blob, seal FROM known WHERE key = ?"
_INSERT = "INSERT OR REPLACE INTO known (key, row, digest, kind, problem, blob, seal) VALUES (?, ?, ?, ?, ?, ?, ?)"

_ERRORS = (sqlite3.Error, OSError, UnicodeDecodeError)
"""The last where SQLite's own message quotes what is damaged."""
_OUT_OF_REACH = {
    sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED, sqlite3.SQLITE_PROTOCOL,
    sqlite3.SQLITE_PERM, sqlite3.SQLITE_AUTH, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_NOMEM, sqlite3.SQLITE_INTERRUPT,
}  # fmt: skip
"""Errors that say nothing of what is in the file."""


class Known(NamedTuple):
    """A row that was read, and a blob whose digest was right, with the states that their files had."""

    row: str
    digest: str | None
    kind: str | None
    """Of a failure, as `problem`."""
    problem: str | None
    blob: str | None


@dataclass
class VerifiedIndex:
    """Rows of one store, by key, in a file of this machine."""

    file: Path
    secret: bytes | None = field(default=None, repr=False)
    """Of the store, if that is sealed: otherwise a row could be made up in here."""
    _new: dict[str, Known] = field(default_factory=dict)
    _connection: sqlite3.Connection | None = None
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _is_out_of_reach: bool = False
    """Locked by another process, or on a disk that fails: each further look would wait as long as the first."""

    def get(self, key: str) -> Known | None:
        """What is remembered of an action."""
        new = self._new.get(key)
        if new is not None or self._is_out_of_reach:
            return new
        with self._lock:
            try:
                if self._connection is None:
                    if not self.file.exists():
                        return None
                    self._connection = self._open()
                found = self._connection.execute(_SELECT, (key,)).fetchone()
            except _ERRORS as error:
                self._forget(error)
                return None
        if found is None:
            return None
        known, seal = Known(*found[:-1]), found[-1]
        return known if seal == _seal(key, known, self.secret) else None

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Many calls of `get` as one transaction: taking and giving back a lock costs more than to read."""
        with self._lock:
            if not self._is_out_of_reach:
                self._begin()
        try:
            yield
        finally:
            with self._lock:
                if self._connection is not None:
                    self._connection.rollback()

    def put(self, key: str, known: Known) -> None:
        """Remember; on disk with the next `save`."""
        self._new[key] = known

    def save(self) -> None:
        """Write down what is new. A memory that cannot be written is done without."""
        if not self._new:
            return
        with self._lock:
            rows = [(key, *known, _seal(key, known, self.secret)) for key, known in list(self._new.items())]
            try:
                self.file.parent.mkdir(parents=True, exist_ok=True)
                self._connection = self._connection or self._open()
                with self._connection:
                    self._connection.execute(_TABLE)
                    self._connection.executemany(_INSERT, rows)
                for key, *_ in rows:
                    self._new.pop(key, None)
            except _ERRORS as error:
                self._forget(error)

    def keep_only(self, keys: Collection[str]) -> None:
        """Forget all actions but these, so that nothing of them stays in the file; OSError where it cannot."""
        self.close()
        self._new.clear()
        if not self.file.exists():
            return
        try:
            with contextlib.closing(sqlite3.connect(self.file, timeout=5)) as connection:
                connection.execute("PRAGMA secure_delete = ON")
                known = {key for (key,) in connection.execute("SELECT key FROM known")}
                with connection:
                    connection.executemany("DELETE FROM known WHERE key = ?", [(key,) for key in known - set(keys)])
                connection.execute("VACUUM")
        except _ERRORS:  # damaged or locked: it can be done without
            self.file.unlink()

    def close(self) -> None:
        """Write down what is new, and let go of the file."""
        self.save()
        with self._lock:
            if self._connection is not None:
                self._connection.close()
                self._connection = None

    def _begin(self) -> None:
        try:
            if self._connection is None and self.file.exists():
                self._connection = self._open()
            if self._connection is not None and not self._connection.in_transaction:
                self._connection.execute("BEGIN")
        except _ERRORS as error:
            self._forget(error)

    def _open(self) -> sqlite3.Connection:
        os.close(os.open(self.file, os.O_RDWR | os.O_CREAT, 0o660))  # SQLite's own would not be for a group to write
        connection = sqlite3.connect(self.file, timeout=5, check_same_thread=False)
        try:
            connection.execute(_TABLE)
            ((pages,),), ((page_size,),) = (connection.execute(f"PRAGMA page_{what}") for what in ("count", "size"))
            if self.file.stat().st_size < pages * page_size:
                raise sqlite3.DatabaseError("cut short, which SQLite takes for zeros")
        except _ERRORS:
            connection.close()
            raise
        return connection

    def _forget(self, error: Exception) -> None:
        """A damaged memory is of no use; one that is busy, or out of reach, stays as it is."""
        log.debug("%s: %s", self.file, error)
        if self._connection is not None:
            with contextlib.suppress(sqlite3.Error):
                self._connection.close()
            self._connection = None
        code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT)  # none where text is no UTF-8
        if isinstance(error, OSError) or code & 0xFF in _OUT_OF_REACH:
            self._is_out_of_reach = True
        else:
            log.warning("%s: damaged, made anew", self.file)
            with contextlib.suppress(OSError):
                self.file.unlink()


def _seal(key: str, known: Known, secret: bytes | None) -> int:
    """SQLite does not see that a bit has changed, nor who has changed it."""
    data = repr((key, *known)).encode()
    if secret is None:
        return zlib.crc32(data)
    return int.from_bytes(hashlib.blake2b(data, key=secret, digest_size=8).digest(), signed=True)
