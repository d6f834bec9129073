"""What the server may read: files of a scan by their fixed names, and nothing that a link leads to."""

import logging
import os
import stat
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import BinaryIO, TypeVar

import numpy as np
from pydantic import ValidationError

from pipelines.scan import DELIVERED
from schemas.base.errors import FootscanError, RefusedInput
from schemas.base.limits import limit, refuse_beyond
from schemas.base.model import pseudonym
from schemas.measures import Measures
from schemas.quality import Quality
from schemas.recording import Recording

log = logging.getLogger("footscan.console")

Parsed = TypeVar("Parsed", Measures, Quality, Recording)
_Made = TypeVar("_Made")

LARGEST_BYTES = 512 * 2**20
"""Of a file that is given out; it is never in memory as a whole."""
LONGEST_TELLING = 200
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".json": "application/json",
    ".stl": "model/stl",
    ".ply": "application/octet-stream",
}
BOUNDS = {".json": "json_bytes", ".ply": "mesh_bytes"}
"""Of a file that a page is made of, by the end of its name."""


def open_result(results: Path, patient: str, scan: str, name: str) -> BinaryIO:
    """RESULTS/<patient>/<scan>/<name>, to be read and closed.

    Raises
    ------
    RefusedInput
        No such result.
    """
    if name not in DELIVERED:
        raise RefusedInput(name[:80], "is no result of a scan")
    file = _open_inside(results, patient, scan, name)
    if os.fstat(file.fileno()).st_size > LARGEST_BYTES:
        file.close()
        raise RefusedInput(results / patient / scan / name, f"expected a file of up to {LARGEST_BYTES} bytes")
    return file


def read_result(results: Path, patient: str, scan: str, name: str) -> bytes:
    """The content of a result that a page is made of; errors as in `open_result`, and BeyondLimitError."""
    if name not in DELIVERED:
        raise RefusedInput(name[:80], "is no result of a scan")
    return _read_inside(results, patient, scan, name)


def version_of(results: Path, patient: str, scan: str, *names: str) -> tuple[int, ...]:
    """What differs once one of the files has been written or swapped; errors as in `open_result`."""
    version = []
    for name in names:
        with open_result(results, patient, scan, name) as file:
            status = os.fstat(file.fileno())
        version += [status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns]
    return tuple(version)


def shown(source: Path, make: Callable[[], _Made]) -> _Made:
    """What `make` makes of the results in the folder `source`.

    Results may be changed by hand or by another program, also while they are read, and no schema foresees all of that.

    Raises
    ------
    RefusedInput
        They cannot be shown, whatever `make` stumbled over.
    """
    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            return make()
    except FootscanError:
        raise
    except Exception as error:
        log.debug("results that cannot be shown", exc_info=True)
        said = f"{type(error).__name__}: {error}"[:LONGEST_TELLING]
        raise RefusedInput(source, f"cannot be shown ({said}), expected results as 'footscan run' has them") from None


def read_measures(results: Path, patient: str, scan: str) -> Measures:
    """Its measures.json; errors as in `read_result`."""
    measures = _parsed(Measures, results, patient, scan, "measures.json")
    refuse_beyond("measures", len(measures.measures), results / patient / scan / "measures.json", field="measures")
    return measures


def read_quality(results: Path, patient: str, scan: str) -> Quality:
    """Its quality.json; errors as in `read_result`."""
    return _parsed(Quality, results, patient, scan, "quality.json")


def read_recording(archive: Path, patient: str, scan: str) -> Recording | None:
    """Its recording.json; None where there is none that can be read, as of scans that another program filmed."""
    try:
        return _parsed(Recording, archive, patient, scan, "recording.json")
    except RefusedInput:
        return None


def _read_inside(root: Path, patient: str, scan: str, name: str) -> bytes:
    """The content of ROOT/<patient>/<scan>/<name>; a file that grows meanwhile is not read further."""
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
    """The regular file ROOT/<patient>/<scan>/<name>.

    Each step is opened from the one before it and none follows a symbolic link, so whatever the names are and whoever
    changes the folders meanwhile, nothing outside is read.
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
            # Without O_NONBLOCK a named pipe would keep us waiting.
            descriptor = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=folder)
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                os.close(descriptor)  # `os.fdopen` would leave that of a folder open
                raise RefusedInput(source, "expected a file")
            return os.fdopen(descriptor, "rb")
        except OSError as error:
            raise RefusedInput(source, f"cannot be read ({error.strerror})") from None


def _parsed(model: type[Parsed], root: Path, patient: str, scan: str, name: str) -> Parsed:
    try:
        return model.model_validate_json(_read_inside(root, patient, scan, name))
    except ValidationError as error:
        problem = f"is not as expected ({error.error_count()} mistakes)"
        raise RefusedInput(root / patient / scan / name, problem) from None
