"""Seals of what the engine writes: a digest that tells damage, and with a secret one that nobody else can make."""

import hmac
import json
from typing import Any

from pipelines.engine.files.digest import sha256
from schemas.base.model import canonical_json

BROKEN = (ValueError, KeyError, TypeError, AttributeError, RecursionError)
"""What `unsealed`, and reading what it gives, may raise."""


class UnsealedError(ValueError):
    """A row that bears no seal of the owner of its store, or a wrong one."""


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
        _check_seal(value, owner_seal, secret)
    return dict(value)


def seal_of(value: dict[str, Any], secret: bytes) -> str:
    """The seal of an object: HMAC-SHA-256 of its canonical JSON (RFC 2104)."""
    return hmac.digest(secret, canonical_json(value).encode(), "sha256").hex()


def _check_seal(value: dict[str, Any], seal: object, secret: bytes) -> None:
    """UnsealedError where an object does not bear this seal."""
    if not isinstance(seal, str) or not hmac.compare_digest(seal.encode(), seal_of(value, secret).encode()):
        raise UnsealedError("bears no seal of its owner")
