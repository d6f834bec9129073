"""Digests of files; a file that has not been touched is not read again."""

import hashlib
import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.digest import FileState, file_state, is_settled, state_of_open
from pipelines.engine.files.seal import BROKEN, sealed, unsealed
from schemas.base.errors import Fault, RefusedInput

log = logging.getLogger("footscan.store")


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
                if state_of_open(file.fileno()) != state:
                    raise RefusedInput(path, "is being written to, expected a finished file")
        except OSError as error:
            problem = "no such file" if isinstance(error, FileNotFoundError) else f"cannot be read ({error.strerror})"
            raise RefusedInput(path, problem) from None
        if is_settled(state):
            self._known[str(path)] = (state, digest)
            self._changed = True
        return digest, state
