"""The content store (blobs by their digest) and the action cache (which action gave which blob).

Every write is atomic; an action's row is written after its blob. Nothing in here is trusted: a blob is checked against
its digest whenever it is read, and a damaged one counts as missing.
"""

import contextlib
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
            with contextlib.suppress(OSError):
                self._blob(digest).unlink()
            return None
        return data

    def has(self, digest: str) -> bool:
        """Whether the blob is there; whether it is sound is seen on reading."""
        return self._blob(digest).is_file()

    def lookup(self, key: str) -> Row | None:
        """The action cache's row for a key, if its result is there."""
        row = self._read_row(key)
        if row is None:
            return None
        return row if row.failure is not None or (row.digest is not None and self.has(row.digest)) else None

    def record(self, step_name: str, row: Row) -> None:
        """Write the row of an action, and remember it as the last one of its step."""
        content = canonical_json({"image": row.image, "digest": row.digest, "failure": row.failure}).encode()
        key = key_of(row.image)
        write_atomically(self._action(key), content)
        write_atomically(self._latest(step_name), key.encode())

    def latest(self, step_name: str) -> Row | None:
        """The last action of a step, whatever its key."""
        try:
            return self._read_row(self._latest(step_name).read_text())
        except (OSError, ValueError):
            return None

    def _blob(self, digest: str) -> Path:
        return self.root / "blobs" / _plain_hex(digest)[:2] / digest

    def _action(self, key: str) -> Path:
        return self.root / "actions" / _plain_hex(key)[:2] / f"{key}.json"

    def _latest(self, step_name: str) -> Path:
        digest = sha256(step_name.encode())
        return self.root / "latest" / digest[:2] / f"{digest}.json"

    def _read_row(self, key: str) -> Row | None:
        path = self._action(key)
        try:
            value: dict[str, Any] = json.loads(path.read_bytes())
            image, digest, failure = value["image"], value["digest"], value["failure"]
            if key_of(image) != key:
                raise ValueError("the row of another action")
            if failure is None:
                return Row(image, _plain_hex(digest))
            kind, problem = failure
            if digest is not None or kind not in {"refused", "finding"} or not isinstance(problem, str):
                raise ValueError("neither a result nor a failure")
            return Row(image, None, (kind, problem))
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            log.warning("%s: damaged, will be made again", path)
            return None


def _plain_hex(digest: Any) -> str:
    """`digest` where it is one: a name out of a file of the cache must not become a path."""
    if not isinstance(digest, str) or len(digest) != 64 or not set(digest) <= set("0123456789abcdef"):
        raise ValueError(f"{str(digest)[:80]!r} is no SHA-256 digest")
    return digest
