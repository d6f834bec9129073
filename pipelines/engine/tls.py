"""TLS certificates for the connection to a Dask scheduler. Both ends present one, signed by a private authority."""

import ssl
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from schemas.base.errors import RefusedInput, one_line

SCHEME = "tls://"
"""Prefix of the address of a scheduler that requires TLS."""


@dataclass(frozen=True)
class Certificates:
    """Files in PEM form."""

    ca: Path
    """Certificate of the authority that signed the certificates of both ends."""
    cert: Path
    """Certificate of this end."""
    key: Path
    """Private key of `cert`, without a password."""


def security_of(certificates: Certificates | None) -> Any:
    """Build the `distributed.Security` for a connection; default certificates: those of Dask's configuration.

    Raises
    ------
    RefusedInput
        A file is missing or is not in PEM form, or the key does not belong to the certificate.
    """
    from distributed.security import Security

    if certificates is None:
        configured = Security()
        paths = [getattr(configured, f"tls_{name}") for name in ("ca_file", "client_cert", "client_key")]
        if None in paths:
            raise RefusedInput(
                f"--cluster {SCHEME}...", "needs certificates, expected --tls-ca, --tls-cert and --tls-key"
            )
        certificates = Certificates(*map(Path, paths))
    _check(certificates)
    return Security(
        tls_ca_file=str(certificates.ca),
        tls_client_cert=str(certificates.cert),
        tls_client_key=str(certificates.key),
        require_encryption=True,
    )


def _check(certificates: Certificates) -> None:
    """Refuse files on which Dask would fail later with a less clear message."""
    for option, path in vars(certificates).items():
        try:
            path.read_bytes()
        except OSError as error:
            problem = "no such file" if isinstance(error, FileNotFoundError) else f"cannot be read ({error.strerror})"
            raise RefusedInput(path, problem, field=f"--tls-{option}") from None
    try:
        context = ssl.create_default_context(cafile=certificates.ca)
    except ssl.SSLError:
        raise RefusedInput(certificates.ca, "expected a certificate in PEM form", field="--tls-ca") from None
    try:
        context.load_cert_chain(certificates.cert, certificates.key, password=lambda: b"")
    except (ssl.SSLError, ValueError) as error:
        reason = getattr(error, "reason", None) or one_line(str(error))
        problem = f"expected a certificate and its own key without a password, both in PEM form ({reason})"
        raise RefusedInput(f"{certificates.cert}, {certificates.key}", problem, field="--tls-cert, --tls-key") from None
