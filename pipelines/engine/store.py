"""The content store (blobs by their digest) and the action cache (which action gave which blob).

Every write is atomic; an action's row is written after its blob. Nothing in here is trusted: a blob is checked against
its digest whenever it is read, and a damaged one counts as missing.
"""

import json
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipelines.engine.atomic import write_atomically
from pipelines.engine.digest import sha256
from pipelines.engine.key import PreImage, key_of
from schemas.documents import canonical_json

log = logging.getLogger("footscan.store")


@dataclass(frozen=True)
class Row:
    """What an action came to."""

    image: PreImage
    """Pre-image of its key."""
    digest: str | None
    """The result, in the content store; None for a failure."""
    failure: tuple[str, str] | None = None
    """Kind (`refused` or `finding`) and problem of an action that failed by its input's fault."""


@dataclass(frozen=True)
class Store:
    """A content store and an action cache in one folder."""

    root: Path

    def put(self, data: bytes) -> str:
        """Keep `data`; returns its digest."""
        digest = sha256(data)
        if self.get(digest) is None:
            write_atomically(self._blob(digest), data)
        return digest

    def get(self, digest: str) -> bytes | None:
        """The blob with this digest; None where it is missing or damaged."""
        try:
            data = self._blob(digest).read_bytes()
        except OSError:
            return None
        if sha256(data) != digest:
            log.warning("%s: damaged, will be made again", self._blob(digest))
            self._blob(digest).unlink(missing_ok=True)
            return None
        return data

    def has(self, digest: str) -> bool:
        """Whether the blob is there; whether it is sound is seen on reading."""
        return self._blob(digest).is_file()

    def lookup(self, key: str) -> Row | None:
        """The action cache's row for a key, if its result is there."""
        row = self._read_row(self._action(key))
        if row is None or key_of(row.image) != key:
            return None
        return row if row.failure is not None or (row.digest is not None and self.has(row.digest)) else None

    def record(self, step_name: str, row: Row) -> None:
        """Write the row of an action, and remember it as the last one of its step."""
        content = canonical_json({"image": row.image, "digest": row.digest, "failure": row.failure}).encode()
        write_atomically(self._action(key_of(row.image)), content)
        write_atomically(self._latest(step_name), content)

    def latest(self, step_name: str) -> Row | None:
        """The last action of a step, whatever its key."""
        return self._read_row(self._latest(step_name))

    def _blob(self, digest: str) -> Path:
        return self.root / "blobs" / _plain_hex(digest)[:2] / digest

    def _action(self, key: str) -> Path:
        return self.root / "actions" / _plain_hex(key)[:2] / f"{key}.json"

    def _latest(self, step_name: str) -> Path:
        digest = sha256(step_name.encode())
        return self.root / "latest" / digest[:2] / f"{digest}.json"

    @staticmethod
    def _read_row(path: Path) -> Row | None:
        try:
            value: dict[str, Any] = json.loads(path.read_bytes())
            failure = value["failure"]
            digest = value["digest"]
            return Row(
                image=dict(value["image"]),
                digest=None if digest is None else _plain_hex(digest),
                failure=None if failure is None else (str(failure[0]), str(failure[1])),
            )
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, TypeError, IndexError):
            log.warning("%s: damaged, will be made again", path)
            return None


def _plain_hex(digest: str) -> str:
    """`digest` where it is one: a name out of a file of the cache must not become a path."""
    if len(digest) != 64 or not set(digest) <= set("0123456789abcdef"):
        raise ValueError(f"{digest[:80]!r} is no SHA-256 digest")
    return digest
