"""What the server may read: files of a scan by their fixed names, and nothing that a link leads to."""

import os
import stat
from contextlib import ExitStack
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from pipelines.scan import DELIVERED
from schemas.documents import pseudonym
from schemas.errors import RefusedInput
from schemas.measures import Measures
from schemas.quality import Quality
from schemas.recording import Recording

Parsed = TypeVar("Parsed", Measures, Quality, Recording)

LARGEST_BYTES = 512 * 2**20
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".json": "application/json",
    ".stl": "model/stl",
    ".ply": "application/octet-stream",
}


def read_result(results: Path, patient: str, scan: str, name: str) -> bytes:
    """The content of RESULTS/<patient>/<scan>/<name>.

    Raises
    ------
    RefusedInput
        No such result.
    """
    if name not in DELIVERED:
        raise RefusedInput(name[:80], "is no result of a scan")
    return _read_inside(results, patient, scan, name)


def read_measures(results: Path, patient: str, scan: str) -> Measures:
    """Its measures.json; errors as in `read_result`."""
    return _parsed(Measures, results, patient, scan, "measures.json")


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
    """The content of ROOT/<patient>/<scan>/<name>.

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
            file = stack.enter_context(os.fdopen(descriptor, "rb"))
            status = os.fstat(descriptor)
            if not stat.S_ISREG(status.st_mode) or status.st_size > LARGEST_BYTES:
                raise RefusedInput(source, "expected a file of a sensible size")
            return file.read()
        except OSError as error:
            raise RefusedInput(source, f"cannot be read ({error.strerror})") from None


def _parsed(model: type[Parsed], root: Path, patient: str, scan: str, name: str) -> Parsed:
    try:
        return model.model_validate_json(_read_inside(root, patient, scan, name))
    except ValidationError as error:
        problem = f"is not as expected ({error.error_count()} mistakes)"
        raise RefusedInput(root / patient / scan / name, problem) from None
