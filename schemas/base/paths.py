"""Paths named in documents."""

from pathlib import Path

from schemas.base.errors import RefusedInput


def inside(archive: Path, document: Path, relative: str, field: str) -> Path:
    """The file `relative` to `document`; RefusedInput if it lies outside `archive`, symbolic links followed."""
    try:
        path = (document.parent / relative).resolve()
    except (OSError, RuntimeError):  # before Python 3.13 a circle of links is a RuntimeError
        raise RefusedInput(document, f"{relative[:80]!r} leads nowhere, expected a path", field=field) from None
    if not path.is_relative_to(archive.resolve()):
        raise RefusedInput(document, f"{relative!r} leaves the archive, expected a path inside it", field=field)
    return path
