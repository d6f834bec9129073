"""Detection of complete scans among those that arrive while footscan runs."""

import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from stat import S_ISDIR
from typing import NamedTuple

from footscan.frames.film import film_files
from footscan.recordings.scans import SCAN_FILE, read_scan, scan_folders
from schemas.base.errors import FootscanError

QUIET_S = 5.0
"""A scan is complete if none of its files has changed for this time, s; chosen by hand. A film that is copied grows.

The age comes from the files' times or, if the clock that set them is ahead of this one, from repeated checks.
"""

State = tuple[tuple[str, int, int], ...]
"""Name, size and time of each file of a scan."""


class _Read(NamedTuple):
    """The content of a scan.yaml that was read."""

    version: tuple[int, int, int, int]
    """Size, mtime, ctime and inode: while these stay, the document is not read again."""
    files: tuple[Path, ...]
    """Files that it names; empty if it breaks its format."""


@dataclass
class Arrivals:
    """The scans of archives, and the state in which each was last reported as complete."""

    archives: tuple[Path, ...]
    _reported: dict[Path, State] = field(default_factory=dict)
    _seen: dict[Path, tuple[State, float]] = field(default_factory=dict)
    """Last state of each scan, and since when it has that state (s, monotonic)."""
    _read: dict[Path, _Read] = field(default_factory=dict)

    def complete(self) -> list[Path]:
        """Return the folders of complete scans that are new or have changed since they were last returned."""
        folders = []
        for archive in self.archives:
            for folder in scan_folders(archive):
                state = self._state(folder, archive)
                if state is None or state == self._reported.get(folder):
                    continue
                if self._is_quiet(folder, state):
                    self._reported[folder] = state
                    folders.append(folder)
        return folders

    def _is_quiet(self, folder: Path, state: State) -> bool:
        now = time.monotonic()
        last_state, since = self._seen.get(folder, (None, now))
        if last_state != state:
            self._seen[folder], since = (state, now), now
        youngest = max(mtime_ns for _, _, mtime_ns in state) / 1e9
        return max(time.time() - youngest, now - since) >= QUIET_S

    def _state(self, folder: Path, archive: Path) -> State | None:
        """State of a scan; None while a film is missing. A scan.yaml that breaks its format has a state: it is refused
        later."""
        document = folder / SCAN_FILE
        try:
            paths = self._named_files(document, archive)
            states = [pair for path in (document, *paths) for pair in _files_of(path)]
        except (OSError, FootscanError):  # also a folder of frames that is still empty
            return None
        return tuple((name, status.st_size, status.st_mtime_ns) for name, status in states)

    def _named_files(self, document: Path, archive: Path) -> tuple[Path, ...]:
        """Files that a scan.yaml names; it is read again only if it has changed.

        A document that was just written is not remembered: it may change again within the resolution of its time stamp.
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


def _files_of(path: Path) -> list[tuple[str, os.stat_result]]:
    """A file, or the files of a film that is a folder of frames; looked at once, since an archive has thousands."""
    status = path.stat()
    if S_ISDIR(status.st_mode):
        return [(str(file), file.stat()) for file in film_files(path)]
    return [(str(path), status)]


def _read_named_files(document: Path, archive: Path) -> tuple[Path, ...]:
    try:
        scan = read_scan(document.parent, archive).document
    except FootscanError:
        return ()
    names = [name for camera in scan.cameras for name in (camera.file, camera.background, camera.positions)]
    names.append(scan.calibration_check)
    return tuple(document.parent / name for name in names if name is not None)
