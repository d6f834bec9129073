"""What an archive holds."""

import datetime
import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from footscan.recordings.scans import read_scan, scan_folders
from schemas.base.errors import FootscanError


class Survey(NamedTuple):
    """An archive as it is found."""

    scans: int
    patients: int
    cameras: int
    """Most cameras of a scan."""
    first: datetime.date | None
    last: datetime.date | None
    """First and last day of its scans, where they are known."""
    scanners: list[str]
    with_calibration: int
    """Scans that name a calibration."""
    problems: list[str]
    """Scans that cannot be read, a sentence each."""
    calibrations: list[Path]
    """Calibrations in it, or beside it."""


def survey(archive: Path, beside: Path) -> Survey:
    """Look through an archive; `beside` is the folder of the workflow, in which calibrations may lie as well."""
    documents, problems = [], []
    for folder in scan_folders(archive):
        try:
            documents.append(read_scan(folder, archive).document)
        except FootscanError as error:
            problems.append(str(error))
    days = sorted(day for document in documents if (day := document.day) is not None)
    return Survey(
        len(documents),
        len({document.patient for document in documents}),
        max((len(document.cameras) for document in documents), default=0),
        days[0] if days else None,
        days[-1] if days else None,
        sorted({document.scanner for document in documents if document.scanner is not None}),
        sum(document.calibration is not None for document in documents),
        problems,
        _calibrations([archive, *archive.glob("*/"), beside, *beside.glob("*/")]),
    )


def _calibrations(folders: Sequence[Path]) -> list[Path]:
    found = {file.resolve() for folder in folders if folder.is_dir() for file in folder.glob("*.json")}
    return sorted(file for file in found if _is_calibration(file))


def _is_calibration(file: Path) -> bool:
    try:
        document = json.loads(file.read_bytes()) if file.stat().st_size < 2**26 else None
    except (OSError, ValueError, RecursionError):
        return False
    kind = document.get("format") if isinstance(document, dict) else None
    return isinstance(kind, str) and kind.startswith("footscan.calibration/")
