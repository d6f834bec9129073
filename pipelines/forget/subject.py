"""The subject of an erasure, and the search for their files in archives and results."""

import hashlib
import os
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from footscan.frames.array import is_chunk_name
from footscan.recordings.scans import read_scan, scan_folders
from schemas.base.errors import FootscanError, RefusedInput
from schemas.base.model import pseudonym
from schemas.frames import GROUP


@dataclass(frozen=True)
class Subject:
    """A patient, or one scan of a patient."""

    patient: str
    scan: str | None = None

    def __post_init__(self) -> None:
        """Refuse names that cannot be folders, such as `..`."""
        pseudonym(self.patient, "PATIENT")
        if self.scan is not None:
            pseudonym(self.scan, "--scan")

    @property
    def name(self) -> str:
        """`patient` or `patient/scan`."""
        return self.patient if self.scan is None else f"{self.patient}/{self.scan}"

    def has(self, scan: str) -> bool:
        """Return True if a scan (`patient/scan`) belongs to the subject."""
        return scan == self.name or (self.scan is None and scan.startswith(f"{self.patient}/"))

    @property
    def pattern(self) -> re.Pattern[bytes]:
        """Pattern of the name in a file, a path or a JSON document; P0001 does not match P00012."""
        if self.scan is None:
            return re.compile(rb"(?<![\w-])" + re.escape(self.patient.encode()) + rb"(?![\w-])", re.ASCII)
        patient, scan = (re.escape(part.encode()) for part in (self.patient, self.scan))
        apart = rb'"patient":\s*"' + patient + rb'",.{0,4000}?"scan":\s*"' + scan + rb'"'
        return re.compile(rb"(?<![\w-])" + patient + rb"/" + scan + rb"(?![\w-])|" + apart, re.ASCII | re.DOTALL)


@dataclass
class Belongings:
    """The subject's files in archives and results."""

    scans: set[str] = field(default_factory=set)
    """`patient/scan` of each scan that was belongings."""
    folders: list[Path] = field(default_factory=list)
    """Folders, and films outside these folders."""
    digests: set[str] = field(default_factory=set)
    """Digests of all files in them, which reveal copies."""
    sizes: set[int] = field(default_factory=set)
    """Sizes of these files, bytes: a file of another size cannot be a copy."""
    out_of_reach: list[str] = field(default_factory=list)
    """Messages about links, whose targets are not erased."""


def find_belongings(subject: Subject, archives: tuple[Path, ...], results: Path) -> Belongings:
    """Find the folders of a subject in archives and results, and the films that only the subject's scans name.

    Raises
    ------
    RefusedInput
        A folder of the subject is a link.
    """
    belongings = Belongings()
    places_of_others: set[Path] = set()
    own_places: set[Path] = set()
    for archive in archives:
        for folder in scan_folders(archive):
            try:
                scan = read_scan(folder, archive)
            except FootscanError:
                if subject.has("/".join(folder.parts[-2:])):
                    _add(folder, archive, belongings)
                continue
            files = {scan.truth or scan.file}
            for camera in scan.document.cameras:
                files |= {file for file in (scan.film(camera), scan.background(camera), scan.positions(camera)) if file}
            if subject.has(scan.name):
                belongings.scans.add(scan.name)
                _add(folder, archive, belongings)
                own_places |= files
            else:
                places_of_others |= files
                places_of_others.add(folder.resolve())
        _add(archive / subject.name, archive, belongings, places_of_others)
        parent = (archive / subject.name).parent
        for part in parent.glob(f".{subject.scan}.partial-*") if subject.scan else ():
            _add(part, archive, belongings)
    for film in sorted(own_places - places_of_others):
        if film.exists() and not any(film.is_relative_to(folder.resolve()) for folder in belongings.folders):
            belongings.folders.append(film)
    _add(results / subject.name, results, belongings)
    for folder in belongings.folders:
        _add_contents(folder, belongings)
    return belongings


def files_below(place: Path) -> Iterator[Path]:
    """Yield all files and links at or below a place; links are not followed."""
    if place.is_symlink() or not place.is_dir():
        yield place
        return
    for here, below, names in os.walk(place):
        yield from (Path(here, name) for name in sorted(names))
        yield from (Path(here, name) for name in below if Path(here, name).is_symlink())


def digest_of(file: Path) -> str | None:
    """Return the SHA-256 of a file; None if it cannot be read."""
    try:
        with file.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError:
        return None


def _add(folder: Path, root: Path, belongings: Belongings, others: Collection[Path] = ()) -> None:
    """Add a folder, unless it is missing, covered by an added one, or contains files of others."""
    if not os.path.lexists(folder) or any(folder.is_relative_to(added) for added in belongings.folders):
        return
    if not folder.resolve().is_relative_to(root.resolve()) or folder.is_symlink():
        raise RefusedInput(folder, "is a link, expected the folder itself; the target of a link is not erased")
    if any(other.is_relative_to(folder.resolve()) for other in others):
        return
    belongings.folders[:] = [added for added in belongings.folders if not added.is_relative_to(folder)]
    belongings.folders.append(folder)


def _add_contents(folder: Path, belongings: Belongings) -> None:
    for file in files_below(folder):
        if file.is_symlink():
            belongings.out_of_reach.append(f"{file} is a link to {os.readlink(file)}: only the link is erased")  # noqa: PTH115
        elif (
            not (GROUP in file.parts and is_chunk_name(file.name))
            and (digest := digest_of(file))
            and file.stat().st_size
        ):
            belongings.digests.add(digest)
            belongings.sizes.add(file.stat().st_size)
