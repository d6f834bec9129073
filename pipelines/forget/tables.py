"""The tables, the page and the logs of an archive, without the lines of those who are forgotten."""

import csv
import json
from collections.abc import Collection
from pathlib import Path

from footscan.recordings.scans import read_scan, scan_folders
from pipelines.archive.job import ScanEnd
from pipelines.archive.page import FILES, PAGE
from pipelines.archive.table import CSV, PARQUET, write_results_table
from pipelines.engine.files.atomic import write_atomically
from pipelines.forget.subject import Subject
from pipelines.scan import DELIVERED
from schemas.base.errors import FootscanError, RefusedInput
from schemas.scan import Scan

TUNE = "tune"
LOGS = ("*.jsonl", "*.ndjson", "*.log", "*.json")


def rewrite_tables(subject: Subject, archives: tuple[Path, ...], results: Path) -> list[str]:
    """Write table and page anew from the table's other rows, where one of them is there; returns what was written."""
    there = [name for name in (CSV, PARQUET, PAGE, FILES) if (results / name).exists()]
    if not there:
        return []
    documents = _documents(archives)
    ends = [_end(row, results, documents) for row in _rows(results) if not _is_theirs(subject, row)]
    (results / PARQUET).unlink(missing_ok=True)  # so that it is written in any case
    write_results_table(ends, results)
    return [str(results / name) for name in there]


def texts_that_name(subject: Subject, folders: list[Path], logs: Collection[Path]) -> list[Path]:
    """Logs beside results and store and elsewhere, files of tuning, and documents of ours, that bear the name.

    RefusedInput where a log elsewhere is no file.
    """
    for log in logs:
        if not _is_file(log):
            raise RefusedInput(log, "is not there, expected a log")
    files = {file for folder in folders for form in LOGS for file in folder.glob(form)}
    files |= {file for folder in folders for file in (folder / TUNE).glob("*")}
    return [file for file in sorted(files | set(logs)) if _is_file(file) and subject.pattern.search(file.read_bytes())]


def erase_from_text(subject: Subject, file: Path) -> None:
    """Take the lines that bear the name out of a log; a document or a page goes as a whole."""
    lines = file.read_bytes().splitlines(keepends=True)
    is_log = file.suffix == ".log" or (len(lines) > 1 and all(_is_object(line) for line in lines if line.strip()))
    left = b"".join(line for line in lines if not subject.pattern.search(line))
    if is_log and left and file.parent.name != TUNE:
        write_atomically(file, left)
    else:
        file.unlink()


def _rows(results: Path) -> list[dict[str, str]]:
    try:
        with (results / CSV).open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))
    except OSError:
        return []


def _is_theirs(subject: Subject, row: dict[str, str]) -> bool:
    scan = row.get("scan", "")
    return subject.has(scan) or subject.pattern.search(scan.encode()) is not None


def _end(row: dict[str, str], results: Path, documents: dict[str, tuple[Path, Scan]]) -> ScanEnd:
    scan, status = row.get("scan", ""), row.get("status", "done")
    folder = results / scan if not Path(scan).is_absolute() and (results / scan).is_dir() else None
    source, document = documents.get(scan, (Path(scan), None))
    digests = {file: row[f"{file}_sha256"] for file in DELIVERED if row.get(f"{file}_sha256")}
    is_there = folder if status in {"done", "finding"} else None
    kind = None if status == "done" else status
    return ScanEnd(scan, source, is_there, row.get("problem") or None, kind, digests, True, document)


def _documents(archives: tuple[Path, ...]) -> dict[str, tuple[Path, Scan]]:
    found = {}
    for archive in archives:
        for folder in scan_folders(archive) if archive.is_dir() else ():
            try:
                scan = read_scan(folder, archive)
            except FootscanError:
                continue
            found[scan.name] = (folder, scan.document)
    return found


def _is_file(file: Path) -> bool:
    return file.is_file() and not file.is_symlink()


def _is_object(line: bytes) -> bool:
    try:
        return isinstance(json.loads(line), dict)
    except (ValueError, RecursionError):
        return False
