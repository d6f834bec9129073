"""Films in a layout of their own: a pattern of their paths says which patient, scan, side and camera each is of."""

import os
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from footscan.recordings.scans import SCAN_FILE
from pipelines.engine.files.atomic import write_atomically
from schemas.base.errors import RefusedInput
from schemas.scan import Scan, Travel

FIELDS = {
    "patient": r"[^/]+?",
    "scan": r"[^/]+?",
    "side": r"(?i:left|right|links|rechts|gauche|droite|droit|[lrgd])",
    "date": r"\d{4}-?\d{2}-?\d{2}",
    "camera": r"\d{1,2}",
}
"""Fields of a pattern, and what each matches; sides in English, German and French."""
NEEDED = ("patient", "camera")
SHOWN = 3
"""Paths that a message gives as examples."""


@dataclass
class FoundScan:
    """The films of one scan."""

    patient: str
    scan: str
    side: str
    date: str | None
    films: dict[int, Path] = field(default_factory=dict)
    """By camera."""
    backgrounds: dict[int, Path] = field(default_factory=dict)


class FilmPattern:
    """A pattern of paths relative to an archive, such as `{patient}/{date}_{side}/cam{camera}.avi`.

    Raises
    ------
    RefusedInput
        It has an unknown field, or lacks one of `NEEDED`.

    >>> FilmPattern("{patient}/{date}_{side}/cam{camera}.avi", "--films").match("anna/20261120_R/cam3.avi")
    {'patient': 'anna', 'date': '20261120', 'side': 'R', 'camera': '3'}
    """

    def __init__(self, pattern: str, option: str) -> None:
        self.text = pattern
        names = re.findall(r"\{(.*?)\}", pattern)
        for name in names:
            if name not in FIELDS:
                raise RefusedInput(option, f"no field {name[:40]!r}, expected some of {', '.join(FIELDS)}")
        for name in NEEDED:
            if name not in names:
                raise RefusedInput(option, f"has no {{{name}}}, expected it in {pattern[:80]!r}")
        parts = re.split(r"(\{.*?\}|\*)", pattern.replace("\\", "/"))
        seen: set[str] = set()
        self._regex = re.compile("".join(self._part(part, seen) for part in parts))

    def match(self, path: str) -> dict[str, str] | None:
        """The fields of a path; None if it does not fit."""
        found = self._regex.fullmatch(path)
        return None if found is None else found.groupdict()

    @staticmethod
    def _part(part: str, seen: set[str]) -> str:
        if part == "*":
            return "[^/]*"
        if not part.startswith("{"):
            return re.escape(part)
        name = part[1:-1]
        if name in seen:  # a field that stands in folder and file, for example
            return f"(?P={name})"
        seen.add(name)
        return f"(?P<{name}>{FIELDS[name]})"


def find_scans(archive: Path, films: FilmPattern, backgrounds: FilmPattern | None = None) -> list[FoundScan]:
    """Find the films of an archive, scan by scan.

    Raises
    ------
    RefusedInput
        No film fits, or two films are of the same camera of one scan.
    """
    scans: dict[tuple[str, str], FoundScan] = {}
    paths = list(_paths(archive))
    for path in paths:
        if (fields := films.match(path)) is not None:
            found = _scan_of(fields)
            scan = scans.setdefault((found.patient, found.scan), found)
            _note(scan.films, int(fields["camera"]), archive / path, scan)
    if not scans:
        examples = ", ".join([path for path in paths if path.lower().endswith(".avi")][:SHOWN]) or "no films"
        raise RefusedInput("--films", f"no path in {archive} fits {films.text!r}; found {examples}")
    for path in paths if backgrounds is not None else ():
        assert backgrounds is not None
        if (fields := backgrounds.match(path)) is not None:
            found = _scan_of(fields)
            if (known := scans.get((found.patient, found.scan))) is not None:
                _note(known.backgrounds, int(fields["camera"]), archive / path, known)
    return list(scans.values())


def write_scans(archive: Path, scans: Sequence[FoundScan], travel: Travel) -> list[Path]:
    """Write scan.yaml for each scan that has none: beside its films, or in `<patient>/<scan>` of the archive where
    films of several scans share a folder. Returns the written files; Fault if one cannot be written.
    """
    of_folder: dict[Path, set[str]] = defaultdict(set)
    for scan in scans:
        for film in scan.films.values():
            of_folder[film.parent].add(f"{scan.patient}/{scan.scan}")
    written = []
    for scan in scans:
        folders = {film.parent for film in scan.films.values()}
        is_own = len(folders) == 1 and len(of_folder[next(iter(folders))]) == 1
        folder = next(iter(folders)) if is_own else archive / scan.patient / scan.scan
        if (folder / SCAN_FILE).exists():
            continue
        document = _document(scan, folder, travel)
        Scan.model_validate(document)
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(
            folder / SCAN_FILE, yaml.safe_dump(document, sort_keys=False, default_flow_style=None).encode()
        )
        written.append(folder / SCAN_FILE)
    return written


def _paths(archive: Path) -> Iterator[str]:
    """Relative paths of all files and folders, with slashes, in order."""
    for folder, below, files in os.walk(archive):
        below[:] = sorted(name for name in below if not name.endswith(".zarr") and not name.startswith("."))
        for name in [*below, *sorted(files)]:
            yield Path(folder, name).relative_to(archive).as_posix()


def _scan_of(fields: Mapping[str, str]) -> FoundScan:
    side = {"l": "left", "g": "left", "r": "right", "d": "right"}.get(fields.get("side", "")[:1].lower(), "unknown")
    date = fields.get("date")
    day = None if date is None else re.sub(r"(\d{4})-?(\d{2})-?(\d{2})", r"\1-\2-\3", date)
    parts = [part for part in (day, {"left": "L", "right": "R"}.get(side)) if part]
    name = _plain(fields["scan"]) if "scan" in fields else "-".join(parts) or "S1"
    if "scan" in fields and side != "unknown":
        name = f"{name}-{side[0].upper()}"  # both feet may have been filmed under one name
    return FoundScan(_plain(fields["patient"]), name, side, day)


def _plain(name: str) -> str:
    """A name as a pseudonym: what it may not hold becomes `_`.

    >>> _plain("Meier, A.")
    'Meier_A'
    """
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_")[:64] or "unnamed"


def _note(places: dict[int, Path], camera: int, path: Path, scan: FoundScan) -> None:
    if camera in places:
        problem = f"{places[camera]} and {path} are both camera {camera} of {scan.patient}/{scan.scan}"
        raise RefusedInput("--films", f"{problem}, expected a pattern that tells scans apart")
    places[camera] = path


def _document(scan: FoundScan, folder: Path, travel: Travel) -> dict[str, object]:
    def relative(path: Path) -> str:
        return Path(os.path.relpath(path, folder)).as_posix()

    cameras = [
        {"id": camera, "file": relative(film)}
        | ({"background": relative(scan.backgrounds[camera])} if camera in scan.backgrounds else {})
        for camera, film in sorted(scan.films.items())
    ]
    dated = {} if scan.date is None else {"date": scan.date}
    return {
        "format": "footscan.scan/1", "patient": scan.patient, "scan": scan.scan, "side": scan.side, **dated,
        "travel": travel.model_dump(), "cameras": cameras,
    }  # fmt: skip
