"""Index of the verified rows and blobs of a store, kept on this machine, so that unchanged files are not read again.

It may be lost: then rows and blobs are read and checked once more.
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
"""Errors of a damaged or unreachable file; UnicodeDecodeError if a message of SQLite quotes damaged text."""
_NOT_DAMAGED = {
    sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED, sqlite3.SQLITE_PROTOCOL,
    sqlite3.SQLITE_PERM, sqlite3.SQLITE_AUTH, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_NOMEM, sqlite3.SQLITE_INTERRUPT,
}  # fmt: skip
"""Codes of SQLite for errors that do not mean that the file is damaged."""


class VerifiedRow(NamedTuple):
    """The outcome in a row that was read and checked, with the states of the files of row and blob."""

    row: str
    """State of the row's file, see `Files.state`."""
    digest: str | None
    kind: str | None
    """Kind of a failure, as in `Row`; None for a result."""
    problem: str | None
    blob: str | None
    """State of the file of a blob whose digest was right; None if it was not checked."""


@dataclass
class VerifiedIndex:
    """Verified rows of one store, by key, in a file of this machine."""

    file: Path
    secret: bytes | None = field(default=None, repr=False)
    """Secret of the store, if it is sealed: without it others could forge rows in this file."""
    _new: dict[str, VerifiedRow] = field(default_factory=dict)
    _connection: sqlite3.Connection | None = None
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _is_out_of_reach: bool = False
    """True if another process locks the file or its disk fails: each further query would wait as long as the first."""

    def get(self, key: str) -> VerifiedRow | None:
        """Return the verified row of an action; None if there is none."""
        new = self._new.get(key)
        if new is not None or self._is_out_of_reach:
            return new
        with self._lock:
            try:
                if self._connection is None:
                    if not self.file.exists():
                        return None
                    self._connection = self._open()
                fields = self._connection.execute(_SELECT, (key,)).fetchone()
            except _ERRORS as error:
                self._handle_error(error)
                return None
        if fields is None:
            return None
        row, seal = VerifiedRow(*fields[:-1]), fields[-1]
        return row if seal == _seal(key, row, self.secret) else None

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Run many calls of `get` as one transaction, since locking and unlocking costs more than reading."""
        with self._lock:
            if not self._is_out_of_reach:
                self._begin()
        try:
            yield
        finally:
            with self._lock:
                if self._connection is not None:
                    self._connection.rollback()

    def put(self, key: str, row: VerifiedRow) -> None:
        """Remember a verified row; `save` writes it to disk."""
        self._new[key] = row

    def save(self) -> None:
        """Write new rows to disk; a failure only costs speed."""
        if not self._new:
            return
        with self._lock:
            rows = [(key, *row, _seal(key, row, self.secret)) for key, row in list(self._new.items())]
            try:
                self.file.parent.mkdir(parents=True, exist_ok=True)
                self._connection = self._connection or self._open()
                with self._connection:
                    self._connection.execute(_TABLE)
                    self._connection.executemany(_INSERT, rows)
                for key, *_ in rows:
                    self._new.pop(key, None)
            except _ERRORS as error:
                self._handle_error(error)

    def keep_only(self, keys: Collection[str]) -> None:
        """Delete all rows but those of `keys`, with their bytes in the file; OSError if the file cannot be deleted."""
        self.close()
        self._new.clear()
        if not self.file.exists():
            return
        try:
            with contextlib.closing(sqlite3.connect(self.file, timeout=5)) as connection:
                connection.execute("PRAGMA secure_delete = ON")
                surplus = {key for (key,) in connection.execute("SELECT key FROM known")}.difference(keys)
                with connection:
                    connection.executemany("DELETE FROM known WHERE key = ?", [(key,) for key in surplus])
                connection.execute("VACUUM")
        except _ERRORS:  # damaged or locked: the index may be lost
            self.file.unlink()

    def close(self) -> None:
        """Write new rows and close the file."""
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
            self._handle_error(error)

    def _open(self) -> sqlite3.Connection:
        os.close(os.open(self.file, os.O_RDWR | os.O_CREAT, 0o660))  # SQLite makes no file for a group to write
        connection = sqlite3.connect(self.file, timeout=5, check_same_thread=False)
        try:
            connection.execute(_TABLE)
            ((pages,),), ((page_size,),) = (
                connection.execute(f"PRAGMA page_{quantity}") for quantity in ("count", "size")
            )
            if self.file.stat().st_size < pages * page_size:
                raise sqlite3.DatabaseError("truncated; SQLite reads missing pages as zeros")
        except _ERRORS:
            connection.close()
            raise
        return connection

    def _handle_error(self, error: Exception) -> None:
        """Close the file after an error, and delete it if it is damaged; a busy or unreachable file stays."""
        log.debug("%s: %s", self.file, error)
        if self._connection is not None:
            with contextlib.suppress(sqlite3.Error):
                self._connection.close()
            self._connection = None
        code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT)  # UnicodeDecodeError has no code
        if isinstance(error, OSError) or code & 0xFF in _NOT_DAMAGED:
            self._is_out_of_reach = True
        else:
            log.warning("%s: damaged, made anew", self.file)
            with contextlib.suppress(OSError):
                self.file.unlink()


def _seal(key: str, row: VerifiedRow, secret: bytes | None) -> int:
    """Checksum of a row, or its keyed digest, since SQLite does not notice a changed bit."""
    data = repr((key, *row)).encode()
    if secret is None:
        return zlib.crc32(data)
    return int.from_bytes(hashlib.blake2b(data, key=secret, digest_size=8).digest(), signed=True)
