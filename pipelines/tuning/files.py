"""Output files of a search: the winner as a workflow, the table of trials, the page."""

import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from pipelines.engine.files.atomic import write_atomically
from pipelines.tuning.report.page import tune_page
from pipelines.tuning.report.result import Trial, TuneResult
from schemas.base.model import canonical_json
from schemas.parameters.scan import ScanParameters
from schemas.tables import Cell, csv_text
from schemas.workflow import Workflow

BEST, CSV, PARQUET, PAGE = "best.yaml", "trials.csv", "trials.parquet", "index.html"


def write_files(
    folder: Path, workflow: Path, document: Workflow, result: TuneResult, parameters: ScanParameters
) -> None:
    """Write all files; Fault if the disk refuses."""
    rows = [_row(trial, result) for trial in result.trials]
    write_atomically(folder / BEST, best_yaml(folder, workflow, document, result, parameters).encode())
    write_atomically(folder / CSV, _as_csv(rows).encode())
    write_atomically(folder / PARQUET, _as_parquet(rows))
    write_atomically(folder / PAGE, tune_page(result).encode())


def best_yaml(folder: Path, workflow: Path, document: Workflow, result: TuneResult, parameters: ScanParameters) -> str:
    """The workflow with the parameters of the winner, for a file in `folder`; its paths are adapted to that folder."""
    base = workflow.resolve().parent

    def moved(path: str) -> str:
        return path if "://" in path or Path(path).is_absolute() else os.path.relpath(base / path, folder.resolve())

    values = document.model_dump(mode="json", exclude_unset=True)
    values["archive"] = [moved(archive) for archive in document.archive]
    values["results"] = moved(document.results)
    for name in {"calibration", "cache"} & values.keys():
        values[name] = None if values[name] is None else moved(values[name])
    for calibration in values.get("calibrations", []):
        for name in {"file", "capture"} & calibration.keys():
            calibration[name] = None if calibration[name] is None else moved(calibration[name])
    values["parameters"] = parameters.model_dump(mode="json", exclude_unset=True)
    trial = f"trial {result.winner.number} of {len(result.trials) - 1}" if result.winner.number else "as it was before"
    head = f"# Found by footscan tune: {trial}. Paths are relative to this file's folder.\n"
    return head + yaml.safe_dump(values, sort_keys=False, default_flow_style=None, allow_unicode=True, width=110)


def _row(trial: Trial, result: TuneResult) -> dict[str, Cell]:
    row: dict[str, Cell] = {
        "trial": trial.number,
        "winner": int(trial.number == result.winner.number),
        "on_front": int(trial.on_front),
        "scans_failed": len(trial.problems),
        "problem": next(iter(trial.problems.values()), None),
    }
    row |= {
        name: value if isinstance(value, str | int | float) else canonical_json(value)
        for name, value in trial.point.items()
    }
    for goal in result.goals:
        column = f"{goal.name}_{'percent' if goal.unit == '%' else goal.unit}"
        row[column] = trial.values[goal.name]
        row |= {f"{column}:{name}": value for name, value in trial.of_sets[goal.name].items()}
    return row


def _as_csv(rows: Sequence[dict[str, Cell]]) -> str:
    return csv_text([rows[0].keys(), *([row[name] for name in rows[0]] for row in rows)])


def _as_parquet(rows: Sequence[dict[str, Cell]]) -> bytes:
    import pyarrow
    from pyarrow import parquet

    columns = {name: [row[name] for row in rows] for name in rows[0]}
    table = pyarrow.table({name: pyarrow.array(cells, _type(cells)) for name, cells in columns.items()})
    out = io.BytesIO()
    parquet.write_table(table, out)
    return out.getvalue()


def _type(cells: Sequence[Cell]) -> Any:
    import pyarrow

    types = {type(cell) for cell in cells if cell is not None}
    if types and types <= {int, bool}:
        return pyarrow.bool_() if types == {bool} else pyarrow.int64()
    return pyarrow.float64() if types and types <= {int, float} else pyarrow.string()
