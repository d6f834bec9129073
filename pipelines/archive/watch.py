"""Scans that arrive while footscan runs: which of them are complete."""

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from footscan.frames.film import film_files
from footscan.recordings.scans import SCAN_FILE, read_scan, scan_folders
from schemas.base.errors import FootscanError

QUIET_S = 5.0
"""A scan is complete when none of its files has changed for so long: a film that is being copied still grows.

That is told by the files' times, or, where the clock that set them is ahead of this one's, by looking again.
"""

State = tuple[tuple[str, int, int], ...]
"""Name, size and time of each file of a scan."""


class _Read(NamedTuple):
    """A scan.yaml that has been read."""

    version: tuple[int, int, int, int]
    """Size, times of content and of inode, and inode: while these stay, the document is not read again."""
    files: tuple[Path, ...]
    """What it names; nothing where it breaks its format."""


@dataclass
class Arrivals:
    """The scans of archives, and in which state each was handed over."""

    archives: tuple[Path, ...]
    _handed_over: dict[Path, State] = field(default_factory=dict)
    _seen: dict[Path, tuple[State, float]] = field(default_factory=dict)
    """The last state of each, and since when it is so (s, monotonic)."""
    _read: dict[Path, _Read] = field(default_factory=dict)

    def complete(self) -> list[Path]:
        """Folders of scans that are complete, and new or changed since they were handed over last."""
        found = []
        for archive in self.archives:
            for folder in scan_folders(archive):
                state = self._state(folder, archive)
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

    def _state(self, folder: Path, archive: Path) -> State | None:
        """None while a film is missing. What breaks its format is handed over, to be refused."""
        document = folder / SCAN_FILE
        try:
            named = self._named_files(document, archive)
            files = [document, *(file for path in named for file in (film_files(path) if path.is_dir() else [path]))]
            states = [(str(file), file.stat()) for file in files]
        except (OSError, FootscanError):  # a folder of frames is empty as yet
            return None
        return tuple((name, status.st_size, status.st_mtime_ns) for name, status in states)

    def _named_files(self, document: Path, archive: Path) -> tuple[Path, ...]:
        """What a scan.yaml names, read anew only where the file has changed.

        One that was written just now is not remembered: it may be written again within a tick of its clock.
        """
        status = document.stat()
        version = (status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino)
        read = self._read.get(document)
        if read is not None and read.version == version:
            return read.files
        files = _read_named_files(document, archive)
        if abs(time.time() - status.st_mtime) >= QUIET_S:
            self._read[document] = _Read(version, files)
        return files


def _read_named_files(document: Path, archive: Path) -> tuple[Path, ...]:
    try:
        scan = read_scan(document.parent, archive).document
    except FootscanError:
        return ()
    named = [name for camera in scan.cameras for name in (camera.file, camera.background, camera.positions)]
    return tuple(document.parent / name for name in named if name is not None)
