"""The content store (blobs by their digest) and the action cache (which action gave which blob).

Every write is atomic; an action's row is written after its blob. Nothing in here is trusted: a row bears a seal, a blob
is checked against its digest whenever it is read, and what is damaged counts as missing. What has not been touched
since it was checked is not read again (`verified`).
"""

import contextlib
import logging
import re
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from pipelines.engine.actions.key import PreImage, key_of
from pipelines.engine.files.digest import sha256
from pipelines.engine.files.places import Files, open_files
from pipelines.engine.files.seal import BROKEN, UnsealedError, sealed, unsealed
from pipelines.engine.files.secret import secret_of
from pipelines.engine.store.verified_index import Known, VerifiedIndex
from schemas.base.errors import Fault

log = logging.getLogger("footscan.store")

KINDS = ("refused", "finding")
"""Of failures that are remembered."""


@dataclass(frozen=True)
class Acceptance:
    """Why a result of an earlier version of the code stands for an action that was not run itself."""

    code: str
    """Digest of that version, see `CodeIdentity`."""
    changes: list[str]
    """What differs between it and the version of the action, a line each."""
    sample: int
    """Actions of the same step and versions that were run again, all with the recorded result."""
    of: int
    """Actions of the same step and versions."""
    date: str
    """ISO 8601, UTC."""
    reason: str
    """In the words of whoever accepted it."""


@dataclass(frozen=True)
class Row:
    """What an action came to."""

    image: PreImage
    """Pre-image of its key."""
    digest: str | None
    """The result, in the content store; None for a failure."""
    failure: tuple[str, str] | None = None
    """Kind (`refused` or `finding`) and problem of an action that failed by its input's fault."""
    accepted: Acceptance | None = None
    """Of an action that was not run: its outcome is that of an earlier version."""


@dataclass(frozen=True)
class Latest:
    """The last action of a step."""

    step: str
    key: str
    sources: dict[str, str]
    """Where the files lay that it took, by the name of the input."""


@dataclass(frozen=True)
class Store:
    """A content store and an action cache in one place."""

    files: Files
    verified: VerifiedIndex | None = None
    secret: bytes | None = field(default=None, repr=False)
    """Of the store's owner, if it is sealed."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _reopened, (self.files,)  # what one machine remembers does not go to another, and secrets do not travel

    def put(self, data: bytes) -> str:
        """Keep `data`; returns its digest."""
        digest = sha256(data)
        if self.get(digest) is None:
            self.files.write(blob_name(digest), data)
        return digest

    def get(self, digest: str) -> bytes | None:
        """The blob with this digest; None where it is missing or damaged."""
        name = blob_name(digest)
        try:
            data = self.files.read(name)
        except OSError:
            return None
        if sha256(data) != digest:
            log.warning("%s: damaged, will be made again", self.files.path(name))
            with contextlib.suppress(OSError, Fault):  # a store that one may only read stays as it is
                self.files.remove(name)
            return None
        return data

    def has(self, digest: str) -> bool:
        """Whether the blob is there; whether it is sound is seen on reading."""
        return self.files.state(blob_name(digest)) is not None

    def lookup(self, key: str) -> Known | None:
        """What an action came to, if its result is there and sound."""
        row_state = self.files.state(row_name(key))
        if row_state is None:
            return None
        known = None if self.verified is None else self.verified.get(key)
        if known is None or known.row != row_state:
            row = self.row(key)
            if row is None:
                return None
            known = _known(row_state, row, None)
        if known.digest is None:
            self._remember(key, known)
            return known
        blob_state = self.files.state(blob_name(known.digest))
        if blob_state is None:
            return None
        if known.blob != blob_state:
            if self.get(known.digest) is None:
                return None
            known = known._replace(blob=blob_state)
            self._remember(key, known)
        return known

    def record(self, step_name: str, row: Row, sources: dict[str, str] | None = None) -> None:
        """Write the row of an action, and remember it as the last one of its step."""
        key = key_of(row.image)
        content = {"image": row.image, "digest": row.digest, "failure": row.failure}
        if row.accepted is not None:
            content["accepted"] = asdict(row.accepted)
        self.files.write(row_name(key), sealed(content, self.secret))
        self.note_latest(step_name, key, sources or {})
        state = self.files.state(row_name(key))
        if self.verified is not None and state is not None:
            blob = None if row.digest is None else self.files.state(blob_name(row.digest))
            self.verified.put(key, _known(state, row, blob))

    def note_latest(self, step_name: str, key: str, sources: dict[str, str]) -> None:
        """Remember an action as the last one of a step."""
        self.files.write(
            latest_name(step_name), sealed({"step": step_name, "key": key, "sources": sources}, self.secret)
        )

    def latest(self, step_name: str) -> Latest | None:
        """The last action of a step, whatever its key."""
        latest = self.read_latest(latest_name(step_name))
        return latest if latest is not None and latest.step == step_name else None

    def read_latest(self, name: str) -> Latest | None:
        """The last action of a step by the name of its file."""
        value = self._read_sealed(name)
        try:
            return None if value is None else Latest(value["step"], plain_hex(value["key"]), dict(value["sources"]))
        except (KeyError, TypeError, ValueError):
            return None

    def row(self, key: str) -> Row | None:
        """The row of an action, whether its result is there or not."""
        value = self._read_sealed(row_name(key))
        if value is None:
            return None
        try:
            image, digest, failure = value["image"], value["digest"], value["failure"]
            if key_of(image) != key:
                raise ValueError("the row of another action")
            accepted = None if "accepted" not in value else Acceptance(**value["accepted"])
            if failure is None:
                return Row(image, plain_hex(digest), None, accepted)
            kind, problem = failure
            if digest is not None or kind not in KINDS or not isinstance(problem, str):
                raise ValueError("neither a result nor a failure")
            return Row(image, None, (kind, problem), accepted)
        except (ValueError, KeyError, TypeError, RecursionError):
            log.warning("%s: damaged, will be made again", self.files.path(row_name(key)))
            return None

    def bears_no_seal(self, key: str) -> bool:
        """Whether there is a row of an action that the owner of a sealed store did not make."""
        try:
            unsealed(self.files.read(row_name(key)), self.secret)
        except UnsealedError:
            return True
        except (OSError, *BROKEN):
            pass
        return False

    def _remember(self, key: str, known: Known) -> None:
        if self.verified is not None:
            self.verified.put(key, known)

    def _read_sealed(self, name: str) -> dict[str, Any] | None:
        """The content of a small file, if its seal is right."""
        try:
            return unsealed(self.files.read(name), self.secret)
        except FileNotFoundError:
            return None
        except UnsealedError as error:
            log.warning("%s: %s, will be made again", self.files.path(name), error)
            return None
        except (OSError, *BROKEN):
            log.warning("%s: damaged, will be made again", self.files.path(name))
            return None


def open_store(place: Path | str, verified: Path | None = None) -> Store:
    """The store at a path or URL, with what the file `verified` remembers of it."""
    files = open_files(place)
    secret = secret_of(files)
    return Store(files, None if verified is None else VerifiedIndex(verified, secret), secret)


def _reopened(files: Files) -> Store:
    """The store where another process works with it."""
    return Store(files, None, secret_of(files))


def blob_name(digest: str) -> str:
    """The file of a blob."""
    return f"blobs/{plain_hex(digest)[:2]}/{digest}"


def row_name(key: str) -> str:
    """The file of an action's row."""
    return f"actions/{plain_hex(key)[:2]}/{key}.json"


def latest_name(step_name: str) -> str:
    """The file that names the last action of a step."""
    digest = sha256(step_name.encode())
    return f"latest/{digest[:2]}/{digest}.json"


_IS_HEX = re.compile("[0-9a-f]{64}").fullmatch


def plain_hex(digest: Any) -> str:
    """`digest` where it is one: a name out of a file of the store must not become a path."""
    if not isinstance(digest, str) or not _IS_HEX(digest):
        raise ValueError(f"{str(digest)[:80]!r} is no SHA-256 digest")
    return digest


def _known(state: str, row: Row, blob_state: str | None) -> Known:
    kind, problem = row.failure or (None, None)
    return Known(state, row.digest, kind, problem, blob_state)
