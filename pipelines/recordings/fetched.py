"""An archive in an object store: its documents are fetched when a job is read, its films when their scan is planned.

Steps read films as files, since a film is read from its end as well. What was fetched is kept, and fetched again where
it has changed in the store.
"""

import json
from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from footscan.recordings.scans import RecordedScan
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.digest import sha256
from pipelines.engine.files.places import DIGESTS, TIMES
from schemas.base.errors import Fault, RefusedInput, one_line
from schemas.frames import GROUP

FILMS = (".avi", ".png", ".jpg", ".jpeg", ".bmp")
"""Endings of the files of films; all others are documents."""
NOTES = "fetched.json"


@dataclass
class FetchedArchive:
    """An archive at a URL of fsspec, and the folder with what was fetched of it.

    Raises
    ------
    RefusedInput
        The URL cannot be opened.
    Fault
        The store cannot be listed or read.
    """

    url: str
    cache: Path
    """Folder in which the archive's own folder is made."""
    _files: Any = field(init=False, repr=False)
    _root: str = field(init=False)
    _states: dict[str, str] = field(init=False, default_factory=dict)
    """State of each file in the store, by its path relative to the archive."""
    _names: list[str] = field(init=False, default_factory=list, repr=False)
    """These paths, in order."""
    _notes: dict[str, str] = field(init=False, default_factory=dict, repr=False)
    """States of the fetched files when they were fetched."""

    def __post_init__(self) -> None:
        """Open the store and list the archive."""
        import fsspec

        try:
            self._files, self._root = fsspec.url_to_fs(self.url)
        except (ValueError, ImportError, OSError) as error:
            raise RefusedInput(self.url, f"cannot be opened ({one_line(str(error))[:120]})", field="archive") from None
        self._states = self._listed()
        self._names = sorted(self._states)
        self._notes = self._noted()

    @property
    def folder(self) -> Path:
        """The folder with what was fetched."""
        return self.cache / "archive" / sha256(self.url.encode())[:16]

    def fetch_documents(self) -> None:
        """Fetch all documents that are new or changed, and remove what is gone in the store."""
        for gone in self._notes.keys() - self._states.keys():
            (self.folder / gone).unlink(missing_ok=True)
        self._fetch(name for name in self._states if not _is_of_film(name))

    def fetch_films(self, scan: RecordedScan) -> None:
        """Fetch the films and backgrounds of a scan that are new or changed."""
        named = [
            film for camera in scan.document.cameras for film in (scan.film(camera), scan.background(camera)) if film
        ]
        roots = [film.relative_to(self.folder.resolve()).as_posix() for film in named]
        self._fetch(name for root in roots for name in self._at(root))

    def _at(self, root: str) -> list[str]:
        """The files at a path or below it."""
        if root in self._states:
            return [root]
        first, last = (bisect_left(self._names, f"{root}{end}") for end in "/0")  # 0 comes after /
        return self._names[first:last]

    def _fetch(self, names: Iterable[str]) -> None:
        notes = self._notes
        stale = [name for name in names if notes.get(name) != self._states[name] or not (self.folder / name).exists()]
        for name in stale:
            try:
                content = self._files.cat_file(f"{self._root}/{name}")
            except Exception as error:  # libraries of stores have errors of their own
                raise Fault(f"{self.url}/{name}: cannot be read ({one_line(str(error))[:120]})") from None
            write_atomically(self.folder / name, content)
            notes[name] = self._states[name]
        if stale or notes.keys() - self._states.keys():
            self._notes = {name: state for name, state in notes.items() if name in self._states}
            write_atomically(self.folder / NOTES, json.dumps(self._notes, sort_keys=True).encode())

    def _listed(self) -> dict[str, str]:
        try:
            self._files.invalidate_cache()
            found = self._files.find(self._root, detail=True)
        except Exception as error:  # as above
            raise Fault(f"{self.url}: cannot be listed ({one_line(str(error))[:120]})") from None
        root = PurePosixPath(self._root.strip("/"))
        return {
            PurePosixPath(path.strip("/")).relative_to(root).as_posix(): _state(info)
            for path, info in found.items()
            if info.get("type", "file") == "file"
        }

    def _noted(self) -> dict[str, str]:
        """States of the fetched files when they were fetched; empty if the notes are lost."""
        try:
            notes = json.loads((self.folder / NOTES).read_bytes())
        except (OSError, ValueError):
            return {}
        return {str(name): str(state) for name, state in notes.items()} if isinstance(notes, dict) else {}


def _is_of_film(name: str) -> bool:
    path = PurePosixPath(name)
    return path.suffix.lower() in FILMS or any(part.endswith(GROUP) for part in path.parts)


def _state(info: dict[str, Any]) -> str:
    """What changes with the content of a file, as far as its store says."""
    known = [str(info[name]) for name in (*DIGESTS, *TIMES) if info.get(name) is not None]
    return " ".join([str(info.get("size")), *known])
