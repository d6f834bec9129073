"""Scans that arrive while footscan runs: which of them are complete."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from footscan.frames.film import film_files
from pipelines.recorded import read_scan, scan_folders
from schemas.errors import FootscanError

QUIET_S = 5.0
"""A scan is complete when none of its files has changed for so long: a film that is being copied still grows.

That is told by the files' times, or, where the clock that set them is ahead of this one's, by looking again.
"""

State = tuple[tuple[str, int, int], ...]
"""Name, size and time of each file of a scan."""


@dataclass
class Arrivals:
    """The scans of archives, and in which state each was handed over."""

    archives: tuple[Path, ...]
    _handed_over: dict[Path, State] = field(default_factory=dict)
    _seen: dict[Path, tuple[State, float]] = field(default_factory=dict)
    """The last state of each, and since when it is so (s, monotonic)."""

    def complete(self) -> list[Path]:
        """Folders of scans that are complete, and new or changed since they were handed over last."""
        found = []
        for archive in self.archives:
            for folder in scan_folders(archive):
                state = _state(folder, archive)
                if state is None or state == self._handed_over.get(folder):
                    continue
                if self._is_quiet(folder, state):
                    self._handed_over[folder] = state
                    found.append(folder)
        return found

    def _is_quiet(self, folder: Path, state: State) -> bool:
        now = time.monotonic()
        seen, since = self._seen.get(folder, (None, now))
        if seen != state:
            self._seen[folder], since = (state, now), now
        youngest = max(mtime_ns for _, _, mtime_ns in state) / 1e9
        return max(time.time() - youngest, now - since) >= QUIET_S


def _state(folder: Path, archive: Path) -> State | None:
    """None while a film is missing. What breaks its format is handed over, to be refused."""
    files = [folder / "scan.yaml"]
    try:
        files += _named_files(folder, archive)
        states = [(str(file), file.stat()) for file in files]
    except OSError:
        return None
    return tuple((name, status.st_size, status.st_mtime_ns) for name, status in states)


def _named_files(folder: Path, archive: Path) -> Iterator[Path]:
    try:
        scan = read_scan(folder, archive)
    except FootscanError:
        return
    for camera in scan.document.cameras:
        for named in (scan.film(camera), scan.background(camera), scan.positions(camera)):
            if named is not None:
                named.stat()
                yield from film_files(named) if named.is_dir() else [named]
