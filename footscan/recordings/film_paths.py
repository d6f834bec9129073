"""Paths that a document of the archive names: where a film, or an array of frames, may lie."""

import os
from pathlib import Path

from schemas.base.errors import RefusedInput
from schemas.base.paths import inside


def film_inside(archive: Path, document: Path, relative: str, field: str) -> Path:
    """The film or array that `document` names, as `inside`; nothing that lies in its folder may lead out either.

    Raises
    ------
    RefusedInput
        The path, or a link in the folder that it leads to, leaves the archive.
    """
    path = inside(archive, document, relative, field)
    try:
        with os.scandir(path) as entries:
            links = [entry.name for entry in entries if entry.is_symlink()]
    except OSError:  # no folder; whether it should be there is for those to say who read it
        return path
    for name in sorted(links):
        place = (path / name).relative_to(archive.resolve())
        try:
            inside(archive, path / name, name, field)
        except RefusedInput as error:
            raise RefusedInput(document, f"{str(place)!r}: {error.problem}", field=field) from None
    return path
