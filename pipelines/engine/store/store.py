"""The content store (blobs by their digest) and the action cache (which action gave which blob).

Every write is atomic; the row of an action is written after its blob. Stored files are not trusted: a row bears a seal,
a blob is checked against its digest whenever it is read, and a damaged file counts as missing. A file that has not
changed since it was checked is not read again (`verified`).
"""

import contextlib
import logging
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from pipelines.engine.actions.key import PreImage, key_of
from pipelines.engine.files.digest import sha256
from pipelines.engine.files.names import blob_name, latest_name, plain_hex, row_name
from pipelines.engine.files.packs import PackedFiles, Snapshot
from pipelines.engine.files.places import LocalFiles, open_files
from pipelines.engine.files.seal import UNSEALING_ERRORS, UnsealedError, sealed, unsealed
from pipelines.engine.files.secret import secret_of
from pipelines.engine.store.verified_index import VerifiedIndex, VerifiedRow
from schemas.base.errors import Fault

log = logging.getLogger("footscan.store")

KINDS = ("refused", "finding")
"""Kinds of failures that are stored."""


@dataclass(frozen=True)
class Acceptance:
    """Acceptance of a result of an earlier version of the code for an action that was not run itself."""

    code: str
    """Digest of that version, see `CodeIdentity`."""
    changes: list[str]
    """Differences between that version and the version of the action, one line each."""
    sample: int
    """Number of actions of the same step and versions that were run again, all with the recorded result."""
    of: int
    """Number of actions of the same step and versions."""
    date: str
    """Date and time of the acceptance, ISO 8601, UTC."""
    reason: str
    """Reason that the user gave."""


@dataclass(frozen=True)
class Row:
    """The recorded outcome of an action."""

    image: PreImage
    """Pre-image of its key."""
    digest: str | None
    """Digest of the result in the content store; None for a failure."""
    failure: tuple[str, str] | None = None
    """Kind (`refused` or `finding`) and problem of an action that failed because of its input."""
    accepted: Acceptance | None = None
    """Set if the action was not run and its outcome is that of an earlier version."""


@dataclass(frozen=True)
class Latest:
    """The last action of a step."""

    step: str
    key: str
    sources: dict[str, str]
    """Paths of the files that it took, by the name of the input."""


@dataclass(frozen=True)
class Store:
    """A content store and an action cache in one place."""

    files: PackedFiles
    verified: VerifiedIndex | None = None
    secret: bytes | None = field(default=None, repr=False)
    """Secret of the store's owner, if the store is sealed."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _reopened, (self.files,)  # the index belongs to one machine, and a secret must not be pickled

    @property
    def folder(self) -> Path | None:
        """Its folder; None if the store is at a URL."""
        place = self.files.place
        return Path(place.root) if isinstance(place, LocalFiles) else None

    def put(self, data: bytes) -> str:
        """Store `data`; returns its digest."""
        digest = sha256(data)
        if self.get(digest) is None:
            self.files.write(blob_name(digest), data)
        return digest

    def get(self, digest: str) -> bytes | None:
        """Return the blob with this digest; None if it is missing or damaged."""
        name = blob_name(digest)
        try:
            data = self.files.read(name)
        except OSError:
            return None
        if sha256(data) != digest:
            log.warning("%s: damaged, will be made again", self.files.path(name))
            with contextlib.suppress(OSError, Fault):  # the store may be read-only
                self.files.remove(name)
            return None
        return data

    def has(self, digest: str) -> bool:
        """Return True if the blob exists; only `get` checks its content."""
        return self.files.state(blob_name(digest)) is not None

    def lookup(self, key: str, files: PackedFiles | Snapshot | None = None) -> VerifiedRow | None:
        """Return the recorded outcome of an action; None if there is none, or its result is missing or damaged.

        files : where the row is looked for; default: the files as they are
        """
        files = files or self.files
        state = files.state
        row_state = state(row_name(key))
        if row_state is None:
            return None
        verified_row = None if self.verified is None else self.verified.get(key)
        if verified_row is None or verified_row.row != row_state:
            row = self.row(key, files)
            if row is None:
                return None
            verified_row = _verified_row(row_state, row, None)
        if verified_row.digest is None:
            self._remember(key, verified_row)
            return verified_row
        blob_state = state(blob_name(verified_row.digest))
        if blob_state is None:
            return None
        if verified_row.blob != blob_state:
            if self.get(verified_row.digest) is None:
                return None
            verified_row = verified_row._replace(blob=blob_state)
            self._remember(key, verified_row)
        return verified_row

    def record(self, step_name: str, row: Row, sources: dict[str, str] | None = None) -> None:
        """Write the row of an action, and note it as the last action of its step."""
        key = key_of(row.image)
        content = {"image": row.image, "digest": row.digest, "failure": row.failure}
        if row.accepted is not None:
            content["accepted"] = asdict(row.accepted)
        self.files.write(row_name(key), sealed(content, self.secret))
        self.note_latest(step_name, key, sources or {})
        state = self.files.state(row_name(key))
        if self.verified is not None and state is not None:
            blob = None if row.digest is None else self.files.state(blob_name(row.digest))
            self.verified.put(key, _verified_row(state, row, blob))

    def note_latest(self, step_name: str, key: str, sources: dict[str, str]) -> None:
        """Note an action as the last one of a step."""
        self.files.write(
            latest_name(step_name), sealed({"step": step_name, "key": key, "sources": sources}, self.secret)
        )

    def latest(self, step_name: str) -> Latest | None:
        """Return the last action of a step; None if there is none or its file is damaged."""
        latest = self.read_latest(latest_name(step_name))
        return latest if latest is not None and latest.step == step_name else None

    def read_latest(self, name: str) -> Latest | None:
        """Return the last action of a step by the name of its file; None as for `latest`."""
        value = self._read_sealed(name)
        try:
            return None if value is None else Latest(value["step"], plain_hex(value["key"]), dict(value["sources"]))
        except (KeyError, TypeError, ValueError):
            return None

    def row(self, key: str, files: PackedFiles | Snapshot | None = None) -> Row | None:
        """Return the row of an action, even if its result is missing; None if the row is missing or damaged.

        files : as in `lookup`
        """
        value = self._read_sealed(row_name(key), files)
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
        """Return True if the store is sealed and the action has a row without the seal of the owner."""
        try:
            unsealed(self.files.read(row_name(key)), self.secret)
        except UnsealedError:
            return True
        except (OSError, *UNSEALING_ERRORS):
            pass
        return False

    def _remember(self, key: str, verified_row: VerifiedRow) -> None:
        if self.verified is not None:
            self.verified.put(key, verified_row)

    def _read_sealed(self, name: str, files: PackedFiles | Snapshot | None = None) -> dict[str, Any] | None:
        """Content of a small file, if its seal is right."""
        try:
            return unsealed((files or self.files).read(name), self.secret)
        except FileNotFoundError:
            return None
        except UnsealedError as error:
            log.warning("%s: %s, will be made again", self.files.path(name), error)
            return None
        except (OSError, *UNSEALING_ERRORS):
            log.warning("%s: damaged, will be made again", self.files.path(name))
            return None


def open_store(place: Path | str, verified: Path | None = None) -> Store:
    """Open the store at a path or URL, with the index of verified results in the file `verified`."""
    files = PackedFiles(open_files(place))
    secret = secret_of(files.place)
    return Store(files, None if verified is None else VerifiedIndex(verified, secret), secret)


def _reopened(files: PackedFiles) -> Store:
    """Open the store of a pickled one in another process."""
    return Store(files, None, secret_of(files.place))


def _verified_row(state: str, row: Row, blob_state: str | None) -> VerifiedRow:
    kind, problem = row.failure or (None, None)
    return VerifiedRow(state, row.digest, kind, problem, blob_state)
