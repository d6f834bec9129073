"""The secret of a store's owner, which seals rows: other users who can write to the store cannot make such rows.

The secret lies outside the store, in a file that only its owner can read. Its existence marks the store as sealed. A
mark in the store could be removed by anyone who can write there.
"""

import os
import re
import secrets
import stat
from pathlib import Path

from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.digest import sha256
from pipelines.engine.files.places import Files
from schemas.base.errors import Fault, RefusedInput

VARIABLE = "FOOTSCAN_SEAL_KEY"
"""Environment variable that names the file of the secret, for every store."""
BYTES = 32
"""Length of a secret. RFC 2104 (section 3) advises at least the length of the digest, here 32 for SHA-256."""


def secret_of(files: Files) -> bytes | None:
    """Read the secret of a store; None if the store is not sealed.

    Raises
    ------
    RefusedInput
        Others can read the file, or the file does not hold a secret.
    """
    path = secret_file(files)
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except FileNotFoundError:
        if VARIABLE in os.environ:
            raise RefusedInput(path, f"no such file, expected the secret that {VARIABLE} names") from None
        return None
    except OSError as error:
        raise RefusedInput(path, f"cannot be read ({error.strerror}), expected the secret of a store") from None
    with open(descriptor, encoding="ascii", errors="replace") as file:  # noqa: PTH123 (opened above)
        status = os.fstat(file.fileno())
        if status.st_mode & (stat.S_IRWXG | stat.S_IRWXO) or status.st_uid not in (0, os.geteuid()):
            raise RefusedInput(
                path, "can be read by others, expected a secret: 'chmod 600', or 'footscan cache seal' anew"
            )
        text = file.read(2 * BYTES + 2).strip()
    if not re.fullmatch(f"[0-9a-f]{{{2 * BYTES}}}", text):
        raise RefusedInput(path, f"holds no secret, expected {2 * BYTES} hexadecimal digits")
    return bytes.fromhex(text)


def make_secret(files: Files) -> bytes:
    """Make a new secret for a store and write its file; Fault if it cannot be written."""
    secret = secrets.token_bytes(BYTES)
    path = secret_file(files)
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    umask = os.umask(0o077)
    try:
        write_atomically(path, f"{secret.hex()}\n".encode())
    finally:
        os.umask(umask)
    return secret


def secret_file(files: Files) -> Path:
    """Path of the secret of a store: in the user's configuration, named by the digest of the store's place."""
    if configured := os.environ.get(VARIABLE):
        return Path(configured)
    configuration = Path(os.environ.get("XDG_CONFIG_HOME", ""))
    try:
        configuration = configuration if configuration.is_absolute() else Path.home() / ".config"
    except RuntimeError:
        raise Fault(f"this user has no home for the secret of a store, expected {VARIABLE}") from None
    return configuration / "footscan" / "seals" / f"{sha256(_place(files).encode())[:32]}.key"


def _place(files: Files) -> str:
    path = files.path("").rstrip("/")
    return path if "://" in path else os.path.realpath(path)
