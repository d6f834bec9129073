"""Names of the files of a store: rows of actions, last actions of steps, and blobs, each by a SHA-256 digest."""

import re
from typing import Any

from pipelines.engine.files.digest import sha256

ROWS, LATEST, BLOBS = "actions", "latest", "blobs"
"""The folders."""

_ENDINGS = {ROWS: ".json", LATEST: ".json", BLOBS: ""}
_IS_HEX = re.compile("[0-9a-f]{64}").fullmatch


def plain_hex(digest: Any) -> str:
    """Return `digest` if it is a SHA-256 digest, else raise ValueError: a text from a file must not become a path."""
    if not isinstance(digest, str) or not _IS_HEX(digest):
        raise ValueError(f"{str(digest)[:80]!r} is no SHA-256 digest")
    return digest


def file_name(folder: str, digest: str) -> str:
    """Return the name of the file of a digest; ValueError if it is not a SHA-256 digest.

    >>> file_name(BLOBS, 64 * "a")[:12]
    'blobs/aa/aaa'
    """
    return f"{folder}/{plain_hex(digest)[:2]}/{digest}{_ENDINGS[folder]}"


def split_name(name: str) -> tuple[str, str] | None:
    """Return the folder and the digest of a name; None for any other file.

    >>> split_name(file_name(ROWS, 64 * "a")) == (ROWS, 64 * "a")
    True
    >>> split_name("pins/P0001.json") is None
    True
    """
    folder, _, rest = name.partition("/")
    digest = rest[3:].removesuffix(_ENDINGS.get(folder, ""))
    is_named = folder in _ENDINGS and _IS_HEX(digest) is not None and name == file_name(folder, digest)
    return (folder, digest) if is_named else None


def blob_name(digest: str) -> str:
    """Return the file name of a blob; ValueError if `digest` is not a SHA-256 digest."""
    return file_name(BLOBS, digest)


def row_name(key: str) -> str:
    """Return the file name of an action's row."""
    return file_name(ROWS, key)


def latest_name(step_name: str) -> str:
    """Return the name of the file that names the last action of a step."""
    return file_name(LATEST, sha256(step_name.encode()))


def row_key(name: str) -> str | None:
    """Return the key in the file name of a row; None for another file."""
    return _digest_in(name, ROWS)


def blob_digest(name: str) -> str | None:
    """Return the digest in the file name of a blob; None for another file."""
    return _digest_in(name, BLOBS)


def _digest_in(name: str, folder: str) -> str | None:
    parts = split_name(name)
    return parts[1] if parts is not None and parts[0] == folder else None
