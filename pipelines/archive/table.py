"""The results of an archive as one table with a row for each scan, as CSV and Parquet; also writes the page."""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

from footscan.recordings.scans import RecordedScan
from pipelines.archive.job import Job
from pipelines.archive.page import write_archive_page
from pipelines.archive.running import ScanEnd
from pipelines.engine.files.atomic import write_atomically
from pipelines.scan import DELIVERABLE
from pipelines.version import SOFTWARE
from schemas.measures import Unit
from schemas.quality import MeshQuality
from schemas.tables import Cell, csv_text

CSV, PARQUET = "results.csv", "results.parquet"
"""File names of the table."""

TEXTS = {
    "scan", "status", "problem", "side", "software", "calibration_sha256", "scanner", "date", "posture",
    "patient", "sex", "calibration_file", "calibration_created", "calibration_software", "parameters_sha256",
    "warnings",
} | {f"{file}_sha256" for file in DELIVERABLE}  # fmt: skip
"""Names of the columns with text, beside those of the measures' status."""
UNITS = get_args(Unit)
"""Units at the end of a column's name."""
SIZE, WIDTH, UNROUNDED = "size_", "width_", "_unrounded"
"""Columns of sizes and widths: `size_eu`, `size_eu_unrounded`, `width_eu`."""
BETWEEN = " | "
"""Between two warnings of a scan."""
_CALIBRATION = {"file": "name", "created": "created", "software": "software"}
"""Columns on the origin of the calibration, without `calibration_`, and the fields of quality.json."""
COUNTS = {"age", "cameras", "frames_lost", "stripe_points", "cloud_points"} | {
    f"mesh_{name}"
    for name, field in MeshQuality.model_json_schema()["properties"].items()
    if {kind["type"] for kind in field.get("anyOf", [field])} <= {"integer", "null"}
}
"""Names of the columns with integers; all others hold measures, distances and shares as floats."""


def write_results_table(ends: Sequence[ScanEnd], folder: Path) -> None:
    """Write `results.csv`, `results.parquet` and `index.html` into the folder of the results, if their content changes.

    A row holds the scan and its status, the foot's side, its measures (the unit is in the name of the column), quality
    figures, the version of this program and the digests of the scan's files; then scanner, date, posture, origin of the
    calibration, digest of the parameters, warnings, and the status and standard deviation of each measure.
    """
    write_archive_page(ends, folder)
    parts = [_row(end) for end in ends]
    rows = [values | trust for values, trust in parts]
    columns = list(dict.fromkeys(name for part in zip(*parts, strict=True) for row in part for name in row))
    table = _as_csv(columns, rows).encode()
    if (folder / PARQUET).exists() and _has_content(folder / CSV, table):
        return
    write_atomically(folder / PARQUET, _as_parquet(columns, rows))
    write_atomically(folder / CSV, table)


def update_results_table(ends: Sequence[ScanEnd], others: Sequence[RecordedScan], job: Job) -> None:
    """Write the table of a job's results, as `write_results_table`, with the rows of other scans as they are in it.

    Raises
    ------
    Fault
        The folder of the results cannot be written.
    """
    others_by_name = {scan.name: scan for scan in others if scan.name not in {end.scan for end in ends}}
    earlier = earlier_ends(job.results, others_by_name) if others_by_name else []
    kept = [end for end in earlier if end.scan in others_by_name]
    place = {folder.resolve(): number for number, folder in enumerate(job.folders)} if kept else {}
    write_results_table(sorted([*ends, *kept], key=lambda end: place.get(end.source, len(place))), job.results)


def earlier_ends(results: Path, scans: Mapping[str, RecordedScan]) -> list[ScanEnd]:
    """The ends of scans as the table in `results` has them, in its order; empty without a table.

    `scans` : the scans that the archive still holds, by name, for what their scan.yaml says.
    """
    try:
        with (results / CSV).open(encoding="utf-8", newline="") as file:
            return [_earlier_end(row, results, scans) for row in csv.DictReader(file)]
    except (OSError, ValueError, csv.Error):
        return []


def _earlier_end(row: dict[str, str], results: Path, scans: Mapping[str, RecordedScan]) -> ScanEnd:
    name, status = row.get("scan") or "", row.get("status") or "done"
    scan = scans.get(name)
    is_there = bool(name) and not Path(name).is_absolute() and (results / name).is_dir()
    return ScanEnd(
        name,
        Path(name) if scan is None else scan.folder,
        results / name if is_there and status in {"done", "finding"} else None,
        row.get("problem") or None,
        None if status == "done" else status,
        {file: row[f"{file}_sha256"] for file in DELIVERABLE if row.get(f"{file}_sha256")},
        was_cached=True,
        document=None if scan is None else scan.document,
        parameters_sha256=row.get("parameters_sha256") or None,
    )


def _row(end: ScanEnd) -> tuple[dict[str, Cell], dict[str, Cell]]:
    """The columns of a scan with what was found, and those that say how far to trust it, which stand after them."""
    row: dict[str, Cell] = {"scan": end.scan, "status": end.kind or "done", "problem": end.problem}
    trust: dict[str, Cell] = {"scanner": None, "date": None, "posture": None, "patient": None, "sex": None, "age": None}
    if end.document is not None:
        day = end.document.day
        trust |= {"scanner": end.document.scanner, "date": None if day is None else day.isoformat()}
        row["side"], trust["posture"] = end.document.side, end.document.posture
        trust |= {"patient": end.document.patient, "sex": end.document.sex, "age": end.document.age}
    trust["parameters_sha256"] = end.parameters_sha256
    if end.folder is None:
        return row, trust
    measures = _read(end.folder / "measures.json")
    row["side"], trust["posture"] = measures.get("side"), measures.get("posture")
    quality = _read(end.folder / "quality.json")
    calibration = quality.get("calibration", {})
    trust |= {f"calibration_{name}": calibration.get(field) for name, field in _CALIBRATION.items()}
    trust["warnings"] = BETWEEN.join(quality.get("scan_warnings") or ()) or None
    for name, measure in measures.get("measures", {}).items():
        suffix = "" if measure["unit"] == "1" else f"_{measure['unit']}"
        row[f"{name}{suffix}"] = measure["value"]
        trust |= {f"{name}_status": measure["status"], f"{name}_sd{suffix}": measure.get("uncertainty")}
    sizes = _read(end.folder / "sizes.json")
    for size in sizes.get("sizes", []):
        name = f"{SIZE}{size['system']}"
        trust |= {name: size["size"], f"{name}{UNROUNDED}": size["unrounded"]}
    for width in sizes.get("widths", []):
        trust |= {f"{WIDTH}{width['system']}": width["width"]}
    cameras = quality.get("cameras", [])
    row["cameras"] = len(cameras)
    row["frames_lost"] = sum(camera["frames_lost"] for camera in cameras)
    row["stripe_points"] = sum(camera["points"] for camera in cameras)
    row["cloud_points"] = quality.get("cloud_points")
    row |= {f"mesh_{name}": value for name, value in quality.get("mesh", {}).items()}
    truth = quality.get("truth") or {}
    row |= {f"truth_{name}_mm": truth[name] for name in ("mean", "p95", "max") if name in truth}
    row["calibration_sha256"] = calibration.get("sha256")
    row["software"] = SOFTWARE
    row |= {f"{file}_sha256": digest for file, digest in sorted(end.digests.items())}
    return row, trust


def _read(path: Path) -> dict[str, Any]:
    try:
        value = json.loads(path.read_bytes())
    except (OSError, ValueError):  # a person may have moved it meanwhile
        return {}
    return value if isinstance(value, dict) else {}


def _has_content(path: Path, content: bytes) -> bool:
    try:
        return path.read_bytes() == content
    except OSError:
        return False


def table_bytes(columns: Sequence[str], rows: Sequence[Mapping[str, Cell]], suffix: str) -> bytes:
    """Rows as a file: `.csv`, or `.parquet` with the unit of each column."""
    return _as_csv(columns, rows).encode() if suffix == ".csv" else _as_parquet(columns, rows)


def _as_csv(columns: Sequence[str], rows: Sequence[Mapping[str, Cell]]) -> str:
    return csv_text([columns, *([row.get(column) for column in columns] for row in rows)])


def _as_parquet(columns: Sequence[str], rows: Sequence[Mapping[str, Cell]]) -> bytes:
    import pyarrow
    from pyarrow import parquet

    table = pyarrow.Table.from_pylist(
        [dict(row) for row in rows], pyarrow.schema([_field(column) for column in columns])
    )
    out = io.BytesIO()
    parquet.write_table(table, out)
    return out.getvalue()


def _field(column: str) -> Any:
    """Name, type and unit of a column: the same in every table, so that tables of several archives can be joined."""
    import pyarrow

    is_size = column.startswith((SIZE, WIDTH)) and not column.endswith(UNROUNDED)
    if column in TEXTS or column == "age_group" or is_size or column.endswith("_status"):
        return pyarrow.field(column, pyarrow.string())
    kind = pyarrow.int64() if column in COUNTS else pyarrow.float64()
    unit = column.rpartition("_")[2]
    return pyarrow.field(column, kind, metadata={"unit": unit if unit in UNITS else "1"})
