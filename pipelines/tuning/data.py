"""Which scans decide a search, and which test its winner."""

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
    """Whether a search is about the scan in a folder, or about one whose name cannot be read: of no other the films are
    looked at."""
    patterns = [*tuning.data, *(tuning.held_out if isinstance(tuning.held_out, list) else [])]
    try:
        name = read_scan(folder, job.archive_of(folder)).name
    except RefusedInput:
        return True
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def split(scans: Sequence[RecordedScan], tuning: Tuning) -> tuple[list[RecordedScan], list[RecordedScan]]:
    """The scans that decide, and those that are held out.

    Raises
    ------
    RefusedInput
        A pattern fits no scan, or no scan is left to decide.
    """
    meant = _fitting(scans, tuning.data, "tune.data")
    if isinstance(tuning.held_out, list):
        held_out = _fitting(scans, tuning.held_out, "tune.held_out")
    else:
        held_out = _drawn(meant, tuning.held_out or 0.0, tuning.seed)
    names = {scan.name for scan in held_out}
    data = [scan for scan in meant if scan.name not in names]
    if not data:
        raise RefusedInput("tune.held_out", "holds all scans out, expected some that decide")
    return data, held_out


def _fitting(scans: Sequence[RecordedScan], patterns: Sequence[str], field: str) -> list[RecordedScan]:
    for pattern in patterns:
        if not any(fnmatchcase(scan.name, pattern) for scan in scans):
            near = difflib.get_close_matches(pattern, [scan.name for scan in scans], n=1)
            hint = f"did you mean {near[0]!r}?" if near else "expected PATIENT/SCAN"
            raise RefusedInput(field, f"no scan that can be read is called {pattern[:80]!r}, {hint}")
    return [scan for scan in scans if any(fnmatchcase(scan.name, pattern) for pattern in patterns)]


def _drawn(scans: Sequence[RecordedScan], share: float, seed: int) -> list[RecordedScan]:
    """That share of the patients, for scans of one foot are too much alike to test each other; of the scans where there
    is but one patient. Another patient in the archive leaves the order of the others as it was."""
    if not share:
        return []
    patients = {scan.name: scan.document.patient for scan in scans}
    if len(set(patients.values())) == 1:
        patients = {name: name for name in patients}
    order = sorted(set(patients.values()), key=lambda patient: sha256(f"{seed}/{patient}".encode()))
    chosen = set(order[: max(round(share * len(order)), 1)])
    return [scan for scan in scans if patients[scan.name] in chosen]
