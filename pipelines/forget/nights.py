"""Regression nights over a patient's scans."""

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
    """The data of a subject in a regression suite."""

    regression: Regression
    sets: list[str]
    """Names of the recorded sets whose scan belongs to the subject."""


def find_nights(subject: Subject, suites: Collection[Regression], folders: Collection[Path]) -> list[Nights]:
    """Find the suites that run scans of the subject.

    Parameters
    ----------
    folders : collection of Path
        Folders that are to be erased.
    """
    affected = []
    for regression in suites:
        base = regression.path.resolve().parent
        recorded_sets = regression.suite.sets.items()
        scans = {name: base / recorded.scan for name, recorded in recorded_sets if recorded.scan is not None}
        names = [name for name, folder in scans.items() if _belongs_to(subject, folder, folders)]
        if names:
            affected.append(Nights(regression, names))
    return affected


def erase_nights(nights: Nights) -> None:
    """Erase the subject's sets from the nights, the history and the baseline of a suite.

    The store and the page of the nights are removed as a whole: the next night makes them anew.

    Raises
    ------
    Fault
        A night is under way, or a file cannot be written.
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


def _belongs_to(subject: Subject, scan: Path, folders: Collection[Path]) -> bool:
    place = scan.resolve()
    return subject.has("/".join(place.parts[-2:])) or any(place.is_relative_to(folder.resolve()) for folder in folders)


def _erase_from_history(file: Path, sets: set[str]) -> None:
    """Remove these sets from each line; a line that cannot be read may hold them and is removed."""
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
