"""Seals of small files of the engine: a digest that shows damage, and an HMAC that only the owner can make."""

import hmac
import json
from typing import Any

from pipelines.engine.files.digest import sha256
from schemas.base.model import canonical_json

UNSEALING_ERRORS = (ValueError, KeyError, TypeError, AttributeError, RecursionError)
"""Errors that `unsealed`, and code that reads its result, may raise."""


class UnsealedError(ValueError):
    """A row without the seal of the owner of its store, or with a wrong one."""


def sealed(value: dict[str, Any], secret: bytes | None = None) -> bytes:
    """An object as canonical JSON, with its digest as `seal` and, given a `secret`, its HMAC as `owner_seal`.

    Examples
    --------
    >>> unsealed(sealed({"key": 1}))
    {'key': 1}
    >>> unsealed(sealed({"key": 1}).replace(b"1", b"2", 1))
    Traceback (most recent call last):
    ValueError: broken seal
    """
    if secret is not None:
        value = {**value, "owner_seal": seal_of(value, secret)}
    return canonical_json({**value, "seal": sha256(canonical_json(value).encode())}).encode()


def unsealed(data: bytes, secret: bytes | None = None) -> dict[str, Any]:
    """The object that was sealed, without its seals.

    Raises
    ------
    One of `UNSEALING_ERRORS`
        `data` is not a sealed object, or its seal is broken.
    UnsealedError
        A `secret` is given, and the object does not bear its seal.
    """
    value = json.loads(data)
    seal = value.pop("seal")
    if seal != sha256(canonical_json(value).encode()):
        raise ValueError("broken seal")
    owner_seal = value.pop("owner_seal", None)
    if secret is not None:
        _check_seal(value, owner_seal, secret)
    return dict(value)


def seal_of(value: dict[str, Any], secret: bytes) -> str:
    """The seal of an object: HMAC-SHA-256 of its canonical JSON (RFC 2104)."""
    return hmac.digest(secret, canonical_json(value).encode(), "sha256").hex()


def _check_seal(value: dict[str, Any], seal: object, secret: bytes) -> None:
    """Raise UnsealedError unless `seal` is the owner's seal of an object."""
    if not isinstance(seal, str) or not hmac.compare_digest(seal.encode(), seal_of(value, secret).encode()):
        raise UnsealedError("bears no seal of its owner")
