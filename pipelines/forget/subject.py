"""Who is to be forgotten, and what is theirs in the archive and in the results."""

import hashlib
import os
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from footscan.recordings.scans import read_scan, scan_folders
from schemas.base.errors import FootscanError, RefusedInput
from schemas.base.model import pseudonym
from schemas.frames import GROUP

CHUNK = re.compile(r"\d+\.0\.0\.0").fullmatch


@dataclass(frozen=True)
class Subject:
    """A patient, or one scan of theirs."""

    patient: str
    scan: str | None = None

    def __post_init__(self) -> None:
        """Refuses names that could not be folders, such as `..`."""
        pseudonym(self.patient, "PATIENT")
        if self.scan is not None:
            pseudonym(self.scan, "--scan")

    @property
    def name(self) -> str:
        """`patient` or `patient/scan`."""
        return self.patient if self.scan is None else f"{self.patient}/{self.scan}"

    def has(self, scan: str) -> bool:
        """Whether a scan (`patient/scan`) is meant."""
        return scan == self.name or (self.scan is None and scan.startswith(f"{self.patient}/"))

    @property
    def pattern(self) -> re.Pattern[bytes]:
        """Finds the name in a file, in a path or in a JSON document; P0001 is not found in P00012."""
        if self.scan is None:
            return re.compile(rb"(?<![\w-])" + re.escape(self.patient.encode()) + rb"(?![\w-])", re.ASCII)
        patient, scan = (re.escape(part.encode()) for part in (self.patient, self.scan))
        apart = rb'"patient":\s*"' + patient + rb'",.{0,4000}?"scan":\s*"' + scan + rb'"'
        return re.compile(rb"(?<![\w-])" + patient + rb"/" + scan + rb"(?![\w-])|" + apart, re.ASCII | re.DOTALL)


@dataclass
class Belongings:
    """What is to be erased of the archives and the results."""

    scans: set[str] = field(default_factory=set)
    """`patient/scan` of each scan that was found."""
    folders: list[Path] = field(default_factory=list)
    """Folders, and films that lie outside of them."""
    digests: set[str] = field(default_factory=set)
    """Of the films and all other files in them, by which copies are found."""
    sizes: set[int] = field(default_factory=set)
    """Of these files, in bytes: no other can be a copy."""
    out_of_reach: list[str] = field(default_factory=list)


def find_belongings(subject: Subject, archives: tuple[Path, ...], results: Path) -> Belongings:
    """The folders of a patient, or of a scan, in archives and results, and the films that only their scans name.

    Raises
    ------
    RefusedInput
        A folder that bears the name is a link, and leads elsewhere.
    """
    found = Belongings()
    others: set[Path] = set()
    named: set[Path] = set()
    for archive in archives:
        for folder in scan_folders(archive):
            try:
                scan = read_scan(folder, archive)
            except FootscanError:
                if subject.has("/".join(folder.parts[-2:])):
                    _add(folder, archive, found)
                continue
            of_cameras = [(scan.film(one), scan.background(one), scan.positions(one)) for one in scan.document.cameras]
            files = {file for files in of_cameras for file in files if file} | {scan.truth or scan.file}
            if subject.has(scan.name):
                found.scans.add(scan.name)
                _add(folder, archive, found)
                named |= files
            else:
                others |= files
                others.add(folder.resolve())
        _add(archive / subject.name, archive, found, others)
        parent = (archive / subject.name).parent
        for part in parent.glob(f".{subject.scan}.partial-*") if subject.scan else ():
            _add(part, archive, found)
    for film in sorted(named - others):
        if film.exists() and not any(film.is_relative_to(folder.resolve()) for folder in found.folders):
            found.folders.append(film)
    _add(results / subject.name, results, found)
    for folder in found.folders:
        _look_into(folder, found)
    return found


def files_below(place: Path) -> Iterator[Path]:
    """All files and links at or below a place; links are not followed."""
    if place.is_symlink() or not place.is_dir():
        yield place
        return
    for here, below, names in os.walk(place):
        yield from (Path(here, name) for name in sorted(names))
        yield from (Path(here, name) for name in below if Path(here, name).is_symlink())


def digest_of(file: Path) -> str | None:
    """SHA-256 of a file; None where it cannot be read."""
    try:
        with file.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError:
        return None


def _add(folder: Path, root: Path, found: Belongings, others: Collection[Path] = ()) -> None:
    """Add a folder, unless it is there or holds what is another's."""
    if not os.path.lexists(folder) or any(folder.is_relative_to(known) for known in found.folders):
        return
    if not folder.resolve().is_relative_to(root.resolve()) or folder.is_symlink():
        raise RefusedInput(folder, "is a link, expected the folder itself: what it leads to is not touched")
    if any(other.is_relative_to(folder.resolve()) for other in others):
        return
    found.folders[:] = [known for known in found.folders if not known.is_relative_to(folder)]
    found.folders.append(folder)


def _look_into(folder: Path, found: Belongings) -> None:
    for file in files_below(folder):
        if file.is_symlink():
            found.out_of_reach.append(f"{file} is a link to {os.readlink(file)}: only the link is erased")  # noqa: PTH115
        elif not (GROUP in file.parts and CHUNK(file.name)) and (digest := digest_of(file)) and file.stat().st_size:
            found.digests.add(digest)
            found.sizes.add(file.stat().st_size)
