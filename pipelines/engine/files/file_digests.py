"""Digests of files; a file whose state has not changed is not read again."""

import hashlib
import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.digest import FileState, file_state, is_settled, state_of_open
from pipelines.engine.files.seal import UNSEALING_ERRORS, sealed, unsealed
from schemas.base.errors import Fault, RefusedInput

log = logging.getLogger("footscan.store")


@dataclass
class FileDigests:
    """Digests of files by path, remembered in one file of the cache."""

    memory: Path
    secret: bytes | None = field(default=None, repr=False)
    """Secret of the store beside which the memory lies, if the store is sealed."""
    _digests: dict[str, tuple[FileState, str]] = field(default_factory=dict)
    _is_changed: bool = False

    @classmethod
    def load(cls, memory: Path, secret: bytes | None = None) -> "FileDigests":
        """Load the remembered digests; empty if the file is missing or damaged."""
        try:
            rows = unsealed(memory.read_bytes(), secret)["rows"]
            return cls(memory, secret, {path: (FileState(*state), str(digest)) for path, state, digest in rows})
        except FileNotFoundError:
            return cls(memory, secret)
        except (OSError, *UNSEALING_ERRORS):
            log.warning("%s: damaged, will be made again", memory)
            return cls(memory, secret)

    def save(self) -> None:
        """Write the digests for the next run; if this fails, the next run reads the files again."""
        if self._is_changed:
            rows = [[path, list(state), digest] for path, (state, digest) in sorted(self._digests.items())]
            try:
                write_atomically(self.memory, sealed({"rows": rows}, self.secret))
            except Fault as error:
                log.warning("%s; the next run will read all films again", error)
            self._is_changed = False

    def forget(self, is_theirs: Callable[[str, str], bool]) -> None:
        """Forget all files for which `is_theirs(path, digest)` holds; Fault if this cannot be written."""
        rows = [[path, list(state), digest] for path, (state, digest) in sorted(self._digests.items())]
        kept_rows = [row for row in rows if not is_theirs(str(row[0]), str(row[2]))]
        if len(kept_rows) < len(rows):
            write_atomically(self.memory, sealed({"rows": kept_rows}, self.secret))
            self._digests = {path: entry for path, entry in self._digests.items() if not is_theirs(path, entry[1])}

    def of(self, path: Path) -> tuple[str, FileState]:
        """Return digest and state of a file; RefusedInput if it cannot be read."""
        try:
            state = file_state(path)
            remembered = self._digests.get(str(path))
            if remembered and remembered[0] == state:
                return remembered[1], state
            with path.open("rb") as file:
                digest = hashlib.file_digest(file, "sha256").hexdigest()
                if state_of_open(file.fileno()) != state:
                    raise RefusedInput(path, "is being written to, expected a finished file")
        except OSError as error:
            problem = "no such file" if isinstance(error, FileNotFoundError) else f"cannot be read ({error.strerror})"
            raise RefusedInput(path, problem) from None
        if is_settled(state):
            self._digests[str(path)] = (state, digest)
            self._is_changed = True
        return digest, state
