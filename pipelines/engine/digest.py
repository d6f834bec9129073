"""Digests of bytes and of files; a file that has not been touched is not read again."""

import hashlib
import json
import logging
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from pipelines.engine.atomic import write_atomically
from pipelines.engine.seal import check_seal, seal_of
from schemas.documents import canonical_json
from schemas.errors import Fault, RefusedInput

log = logging.getLogger("footscan.store")

BROKEN = (ValueError, KeyError, TypeError, AttributeError, RecursionError)
"""What `unsealed`, and reading what it gives, may raise."""

SETTLED_NS = 2_000_000_000
"""A file younger than this may change again within its time stamp's resolution: its digest is not remembered."""


class FileState(NamedTuple):
    """What the file system says of a file; a change of content changes it (ctime cannot be set back)."""

    size: int
    mtime_ns: int
    ctime_ns: int
    inode: int


def sha256(data: bytes) -> str:
    """Hexadecimal SHA-256 of `data`."""
    return hashlib.sha256(data).hexdigest()


def sealed(value: dict[str, Any], secret: bytes | None = None) -> bytes:
    """An object as canonical JSON, with its digest as `seal`; with a `secret` also with what none makes without."""
    if secret is not None:
        value = {**value, "owner_seal": seal_of(value, secret)}
    return canonical_json({**value, "seal": sha256(canonical_json(value).encode())}).encode()


def unsealed(data: bytes, secret: bytes | None = None) -> dict[str, Any]:
    """The object that was sealed; one of the errors in `BROKEN` where it is none, UnsealedError where it bears not the
    seal of the `secret`, if any."""
    value = json.loads(data)
    seal = value.pop("seal")
    if seal != sha256(canonical_json(value).encode()):
        raise ValueError("broken seal")
    owner_seal = value.pop("owner_seal", None)
    if secret is not None:
        check_seal(value, owner_seal, secret)
    return dict(value)


def file_state(path: Path) -> FileState:
    """The present state of a file; OSError where there is none."""
    status = path.stat()
    return FileState(status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino)


def is_settled(state: FileState) -> bool:
    """Whether a further change of the file would change its state, too."""
    return time.time_ns() - max(state.mtime_ns, state.ctime_ns) > SETTLED_NS


@dataclass
class FileDigests:
    """Digests of files by path, remembered in one file of the cache."""

    memory: Path
    secret: bytes | None = field(default=None, repr=False)
    """Of the store beside which it lies, if that is sealed."""
    _known: dict[str, tuple[FileState, str]] = field(default_factory=dict)
    _changed: bool = False

    @classmethod
    def load(cls, memory: Path, secret: bytes | None = None) -> "FileDigests":
        """What was remembered; nothing where the file is missing or damaged."""
        try:
            rows = unsealed(memory.read_bytes(), secret)["rows"]
            return cls(memory, secret, {path: (FileState(*state), str(digest)) for path, state, digest in rows})
        except FileNotFoundError:
            return cls(memory, secret)
        except (OSError, *BROKEN):
            log.warning("%s: damaged, will be made again", memory)
            return cls(memory, secret)

    def save(self) -> None:
        """Remember for the next run; where that cannot be, it reads the files again."""
        if self._changed:
            rows = [[path, list(state), digest] for path, (state, digest) in sorted(self._known.items())]
            try:
                write_atomically(self.memory, sealed({"rows": rows}, self.secret))
            except Fault as error:
                log.warning("%s; the next run will read all films again", error)
            self._changed = False

    def forget(self, is_theirs: Callable[[str, str], bool]) -> None:
        """Remember no file whose path and digest are somebody's; Fault where that cannot be written."""
        rows = [[path, list(state), digest] for path, (state, digest) in sorted(self._known.items())]
        left = [row for row in rows if not is_theirs(str(row[0]), str(row[2]))]
        if len(left) < len(rows):
            write_atomically(self.memory, sealed({"rows": left}))
            self._known = {path: known for path, known in self._known.items() if not is_theirs(path, known[1])}

    def of(self, path: Path) -> tuple[str, FileState]:
        """Digest and state of a file; RefusedInput where it cannot be read."""
        try:
            state = file_state(path)
            known = self._known.get(str(path))
            if known and known[0] == state:
                return known[1], state
            with path.open("rb") as file:
                digest = hashlib.file_digest(file, "sha256").hexdigest()
                if FileState(*_state_of(file.fileno())) != state:
                    raise RefusedInput(path, "is being written to, expected a finished file")
        except OSError as error:
            problem = "no such file" if isinstance(error, FileNotFoundError) else f"cannot be read ({error.strerror})"
            raise RefusedInput(path, problem) from None
        if is_settled(state):
            self._known[str(path)] = (state, digest)
            self._changed = True
        return digest, state


def _state_of(descriptor: int) -> tuple[int, int, int, int]:
    status = os.fstat(descriptor)
    return status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino
