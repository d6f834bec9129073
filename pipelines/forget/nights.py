"""The nights of a regression over a patient's scans."""

import json
import shutil
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from pipelines.engine.files.atomic import write_atomically
from pipelines.forget.subject import Subject
from pipelines.regression.baseline import forget_sets
from pipelines.regression.history import FILE, alone
from pipelines.regression.night import PAGE, Regression


@dataclass(frozen=True)
class Nights:
    """What a suite knows of the subject."""

    regression: Regression
    sets: list[str]
    """Recorded sets whose scan is the subject's."""


def find_nights(subject: Subject, suites: Collection[Regression], folders: Collection[Path]) -> list[Nights]:
    """The suites that run scans of the subject.

    Parameters
    ----------
    folders : collection of Path
        Folders that are to be erased.
    """
    found = []
    for regression in suites:
        base = regression.path.resolve().parent
        scans = {name: base / one.scan for name, one in regression.suite.sets.items() if one.scan is not None}
        names = [name for name, folder in scans.items() if _is_theirs(subject, folder, folders)]
        if names:
            found.append(Nights(regression, names))
    return found


def erase_nights(nights: Nights) -> None:
    """Erase what the nights, the history and the baseline of a suite hold of the subject's sets.

    The store of the nights goes as a whole: the next night computes all sets anew. The page is drawn by that night.

    Raises
    ------
    Fault
        A night is under way, or the disk refuses.
    """
    out = nights.regression.out
    if out.is_dir():
        with alone(out):
            for name in nights.sets:
                shutil.rmtree(out / "results" / name, ignore_errors=True)
            shutil.rmtree(out / "cache", ignore_errors=True)
            (out / PAGE).unlink(missing_ok=True)
            _erase_from_history(out / FILE, set(nights.sets))
    forget_sets(nights.regression.baseline, out, set(nights.sets))


def _is_theirs(subject: Subject, scan: Path, folders: Collection[Path]) -> bool:
    resolved = scan.resolve()
    return subject.has("/".join(resolved.parts[-2:])) or any(resolved.is_relative_to(one.resolve()) for one in folders)


def _erase_from_history(file: Path, sets: set[str]) -> None:
    """Each line without these sets; a line that cannot be read may hold anything, and goes."""
    if not file.exists():
        return
    kept = []
    for line in file.read_bytes().splitlines():
        try:
            night = json.loads(line)
            for part in ("sets", "problems"):
                night[part] = {name: value for name, value in night.get(part, {}).items() if name not in sets}
            night["worse"] = [name for name in night.get("worse", []) if name.partition(":")[0] not in sets]
        except (ValueError, TypeError, AttributeError, RecursionError):
            continue
        if night.get("event") == "begun":
            night = {name: value for name, value in night.items() if value}
        kept.append(json.dumps(night, sort_keys=True, separators=(",", ":")).encode() + b"\n")
    write_atomically(file, b"".join(kept))
