"""Removal of a subject from the tables, the page and the logs of an archive."""

import contextlib
import json
from collections.abc import Collection, Iterator
from pathlib import Path

from footscan.recordings.scans import RecordedScan, read_scan, scan_folders
from pipelines.archive.page import FILES, PAGE
from pipelines.archive.table import CSV, PARQUET, earlier_ends, write_results_table
from pipelines.engine.files.atomic import write_atomically
from pipelines.forget.subject import Subject
from schemas.base.errors import FootscanError, RefusedInput

TUNE = "tune"
"""Folder of the files of tuning."""
LOGS = ("*.jsonl", "*.ndjson", "*.log", "*.json")
"""Patterns of the names of logs and documents."""


def rewrite_tables(subject: Subject, archives: tuple[Path, ...], results: Path) -> list[str]:
    """Write table and page anew from the rows of other subjects, if one of them exists; returns the written paths."""
    existing = [name for name in (CSV, PARQUET, PAGE, FILES) if (results / name).exists()]
    if not existing:
        return []
    ends = [
        end
        for end in earlier_ends(results, {scan.name: scan for scan in _scans(archives)})
        if not (subject.has(end.scan) or subject.pattern.search(end.scan.encode()))
    ]
    (results / PARQUET).unlink(missing_ok=True)  # a missing file is always written
    write_results_table(ends, results)
    return [str(results / name) for name in existing]


def texts_that_name(subject: Subject, folders: list[Path], logs: Collection[Path]) -> list[Path]:
    """Find logs, documents and files of tuning that contain the subject's name, in `folders` and among `logs`.

    Raises
    ------
    RefusedInput
        One of `logs` is not a file.
    """
    for log in logs:
        if not _is_file(log):
            raise RefusedInput(log, "no such file, expected a log")
    files = {file for folder in folders for form in LOGS for file in folder.glob(form)}
    files |= {file for folder in folders for file in (folder / TUNE).glob("*")}
    return [file for file in sorted(files | set(logs)) if _is_file(file) and subject.pattern.search(file.read_bytes())]


def erase_from_text(subject: Subject, file: Path) -> None:
    """Remove the lines with the subject's name from a log; a document or a page is deleted as a whole."""
    lines = file.read_bytes().splitlines(keepends=True)
    is_log = file.suffix == ".log" or (len(lines) > 1 and all(_is_object(line) for line in lines if line.strip()))
    kept = b"".join(line for line in lines if not subject.pattern.search(line))
    if is_log and kept and file.parent.name != TUNE:
        write_atomically(file, kept)
    else:
        file.unlink()


def _scans(archives: tuple[Path, ...]) -> Iterator[RecordedScan]:
    """All scans that can be read."""
    for archive in archives:
        for folder in scan_folders(archive) if archive.is_dir() else ():
            with contextlib.suppress(FootscanError):
                yield read_scan(folder, archive)


def _is_file(file: Path) -> bool:
    return file.is_file() and not file.is_symlink()


def _is_object(line: bytes) -> bool:
    try:
        return isinstance(json.loads(line), dict)
    except (ValueError, RecursionError):
        return False
