"""Choice of the scans that decide a search, and of those that test its winner."""

import difflib
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from footscan.recordings.scans import RecordedScan, read_scan
from pipelines.archive.job import Job
from pipelines.engine.files.digest import sha256
from schemas.base.errors import RefusedInput
from schemas.tuning import Tuning


def may_be_meant(folder: Path, job: Job, tuning: Tuning) -> bool:
    """True if a search may include the scan in a folder: its name fits, or cannot be read.

    The films of other scans are not read.
    """
    patterns = [*tuning.data, *(tuning.held_out if isinstance(tuning.held_out, list) else [])]
    try:
        name = read_scan(folder, job.archive_of(folder)).name
    except RefusedInput:
        return True
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def split(scans: Sequence[RecordedScan], tuning: Tuning) -> tuple[list[RecordedScan], list[RecordedScan]]:
    """Split scans into those that decide and those that are held out.

    Raises
    ------
    RefusedInput
        A pattern fits no scan, or all scans are held out.
    """
    included = _fitting(scans, tuning.data, "tune.data")
    if isinstance(tuning.held_out, list):
        held_out = _fitting(scans, tuning.held_out, "tune.held_out")
    else:
        held_out = _drawn(included, tuning.held_out or 0.0, tuning.seed)
    names = {scan.name for scan in held_out}
    data = [scan for scan in included if scan.name not in names]
    if not data:
        raise RefusedInput("tune.held_out", "holds all scans out, expected to leave some that decide")
    return data, held_out


def _fitting(scans: Sequence[RecordedScan], patterns: Sequence[str], field: str) -> list[RecordedScan]:
    for pattern in patterns:
        if not any(fnmatchcase(scan.name, pattern) for scan in scans):
            similar = difflib.get_close_matches(pattern, [scan.name for scan in scans], n=1)
            hint = f"did you mean {similar[0]!r}?" if similar else "expected PATIENT/SCAN"
            raise RefusedInput(field, f"no scan that can be read is called {pattern[:80]!r}, {hint}")
    return [scan for scan in scans if any(fnmatchcase(scan.name, pattern) for pattern in patterns)]


def _drawn(scans: Sequence[RecordedScan], share: float, seed: int) -> list[RecordedScan]:
    """Draw a share of the patients, since scans of one foot are too similar to test each other.

    If all scans are of one patient, a share of the scans is drawn. A new patient in the archive does not change the
    order of the others.
    """
    if not share:
        return []
    patients = {scan.name: scan.document.patient for scan in scans}
    if len(set(patients.values())) == 1:
        patients = {name: name for name in patients}
    order = sorted(set(patients.values()), key=lambda patient: sha256(f"{seed}/{patient}".encode()))
    chosen = set(order[: max(round(share * len(order)), 1)])
    return [scan for scan in scans if patients[scan.name] in chosen]
