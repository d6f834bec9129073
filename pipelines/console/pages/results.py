"""Read access of the server: the files of a scan by their fixed names, without following links."""

import logging
import os
import stat
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import BinaryIO, TypeVar

import numpy as np
from pydantic import ValidationError

from pipelines.scan import DELIVERABLE
from schemas.base.errors import FootscanError, RefusedInput
from schemas.base.limits import limit, refuse_beyond
from schemas.base.model import pseudonym
from schemas.known_measures import KnownMeasures
from schemas.measures import Measures
from schemas.quality import Quality

log = logging.getLogger("footscan.console")

Parsed = TypeVar("Parsed", Measures, Quality, KnownMeasures)
_Made = TypeVar("_Made")

LARGEST_BYTES = 512 * 2**20
"""Largest file that is sent; it is never in memory as a whole."""
LONGEST_PROBLEM = 200
"""Most characters of an unforeseen error that are shown."""
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".json": "application/json",
    ".stl": "model/stl",
    ".ply": "application/octet-stream",
}
BOUNDS = {".json": "json_bytes", ".ply": "mesh_bytes"}
"""Bound of the size of a file that is read as a whole, by suffix: names in `schemas.base.limits`."""


LATER = ("sizes.json",)
"""Results that earlier versions of this program did not make."""


def open_result(results: Path, patient: str, scan: str, name: str) -> BinaryIO:
    """Open RESULTS/<patient>/<scan>/<name> for reading; the caller closes it.

    Raises
    ------
    RefusedInput
        No such result.
    """
    if name not in DELIVERABLE:
        raise RefusedInput(name[:80], "is not a result of a scan")
    file = _open_inside(results, patient, scan, name)
    if os.fstat(file.fileno()).st_size > LARGEST_BYTES:
        file.close()
        raise RefusedInput(results / patient / scan / name, f"expected a file of up to {LARGEST_BYTES} bytes")
    return file


def read_result(results: Path, patient: str, scan: str, name: str) -> bytes:
    """Read a result as a whole; errors as in `open_result`, and BeyondLimitError."""
    if name not in DELIVERABLE:
        raise RefusedInput(name[:80], "is not a result of a scan")
    return _read_inside(results, patient, scan, name)


def version_of(results: Path, patient: str, scan: str, *names: str) -> tuple[int, ...]:
    """A fingerprint of files that changes if one is written or replaced; errors as in `open_result`.

    Results of an earlier version of this program have no file of `LATER`.
    """
    version: list[int] = []
    for name in names:
        if name in LATER and not (results / patient / scan / name).exists():
            continue
        with open_result(results, patient, scan, name) as file:
            status = os.fstat(file.fileno())
        version += [status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns]
    return tuple(version)


def guarded(source: Path, make: Callable[[], _Made]) -> _Made:
    """Run `make` on the results in the folder `source`, and turn any exception into a RefusedInput.

    Results may be changed by hand or by another program, even while they are read; no schema covers all such changes.

    Raises
    ------
    RefusedInput
        The results cannot be shown.
    """
    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            return make()
    except FootscanError:
        raise
    except Exception as error:  # damaged results can make any of the readers raise anything
        log.debug("results that cannot be shown", exc_info=True)
        problem = f"{type(error).__name__}: {error}"[:LONGEST_PROBLEM]
        raise RefusedInput(source, f"cannot be shown ({problem}), expected results of 'footscan run'") from None


def read_measures(results: Path, patient: str, scan: str) -> Measures:
    """Read measures.json of a scan; errors as in `read_result`."""
    measures = _parsed(Measures, results, patient, scan, "measures.json")
    refuse_beyond("measures", len(measures.measures), results / patient / scan / "measures.json", field="measures")
    return measures


def read_quality(results: Path, patient: str, scan: str) -> Quality:
    """Read quality.json of a scan; errors as in `read_result`."""
    return _parsed(Quality, results, patient, scan, "quality.json")


def read_known(archive: Path, patient: str, scan: str) -> KnownMeasures | None:
    """Read known.json of a virtual foot's scan; None if it is missing or invalid, as for the scan of a person."""
    try:
        return _parsed(KnownMeasures, archive, patient, scan, "known.json")
    except RefusedInput:
        return None


def _read_inside(root: Path, patient: str, scan: str, name: str) -> bytes:
    """Read ROOT/<patient>/<scan>/<name>, no further than its bound even if it grows meanwhile."""
    source, bound = root / patient / scan / name, BOUNDS[Path(name).suffix]
    with _open_inside(root, patient, scan, name) as file:
        refuse_beyond(bound, os.fstat(file.fileno()).st_size, source)
        try:
            content = file.read(limit(bound) + 1)
        except OSError as error:
            raise RefusedInput(source, f"cannot be read ({error.strerror})") from None
    refuse_beyond(bound, len(content), source)
    return content


def _open_inside(root: Path, patient: str, scan: str, name: str) -> BinaryIO:
    """Open the regular file ROOT/<patient>/<scan>/<name>.

    Each folder is opened relative to its parent, and symbolic links are not followed: nothing outside of ROOT is read,
    even if the folders change meanwhile.
    """
    steps = pseudonym(patient, "patient"), pseudonym(scan, "scan")
    source = root / patient / scan / name
    with ExitStack() as stack:
        try:
            folder = os.open(root, os.O_RDONLY | os.O_DIRECTORY)
            stack.callback(os.close, folder)
            for step in steps:
                folder = os.open(step, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=folder)
                stack.callback(os.close, folder)
            # Without O_NONBLOCK the call would block on a named pipe.
            descriptor = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=folder)
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                os.close(descriptor)  # `os.fdopen` would not close the descriptor of a folder
                raise RefusedInput(source, "expected a file")
            return os.fdopen(descriptor, "rb")
        except OSError as error:
            raise RefusedInput(source, f"cannot be read ({error.strerror})") from None


def _parsed(model: type[Parsed], root: Path, patient: str, scan: str, name: str) -> Parsed:
    try:
        return model.model_validate_json(_read_inside(root, patient, scan, name))
    except ValidationError as error:
        problem = f"does not match its schema ({error.error_count()} errors)"
        raise RefusedInput(root / patient / scan / name, problem) from None
