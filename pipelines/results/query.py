"""Questions to the table of an archive's results: rows that meet conditions, and statistics of groups of them."""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pipelines.archive.table import PARQUET, UNITS
from schemas.base.errors import RefusedInput
from schemas.tables import Cell

Row = Mapping[str, Cell]

OPERATORS: Mapping[str, Callable[[Any, Any], bool]] = {
    ">=": lambda cell, value: cell >= value,
    "<=": lambda cell, value: cell <= value,
    "!=": lambda cell, value: cell != value,
    "=": lambda cell, value: cell == value,
    ">": lambda cell, value: cell > value,
    "<": lambda cell, value: cell < value,
    "~": lambda cell, value: str(value).lower() in str(cell).lower(),
}
STATUS = "_status"
PERCENTILES = (5, 50, 95)
AGE_YEARS = 10
"""Years of a group of ages."""


class ResultsTable(NamedTuple):
    """The table of an archive."""

    columns: list[str]
    units: dict[str, str]
    """Unit of each column of numbers; 1 for counts, shares and ratios."""
    rows: list[dict[str, Cell]]


class Condition(NamedTuple):
    """What a row must meet: `foot_length_mm>=260`, `side=left`, or `warnings~camera`."""

    column: str
    operator: str
    value: str

    @classmethod
    def parse(cls, text: str, table: ResultsTable) -> "Condition":
        """The condition of an option; RefusedInput if it is none, or names no column.

        >>> Condition.parse("side=left", ResultsTable(["side"], {}, []))
        Condition(column='side', operator='=', value='left')
        """
        match = re.fullmatch(r"\s*([A-Za-z0-9_.]+)\s*(>=|<=|!=|==?|>|<|~)\s*(.*?)\s*", text)
        if match is None:
            expected = "expected a column, one of = != < <= > >= ~ and a value, such as foot_length_mm>=260"
            raise RefusedInput("--where", f"{expected}, found {text[:80]!r}")
        column, operator, value = match.groups()
        operator = "=" if operator == "==" else operator
        column = known_column(column, table, "--where")
        if column in table.units and operator != "~" and value and not _is_number(value):
            raise RefusedInput("--where", f"{column} holds numbers, expected one, found {value[:40]!r}")
        return cls(column, operator, value)

    def holds(self, row: Row) -> bool:
        """Return True if a row meets it. An empty cell meets only `=` and `!=` with an empty value."""
        cell = row.get(self.column)
        if self.value == "" or cell is None:
            is_empty = cell is None or cell == ""
            return self.value == "" and {"=": is_empty, "!=": not is_empty}.get(self.operator, False)
        value: Cell = float(self.value) if not isinstance(cell, str) and _is_number(self.value) else self.value
        return OPERATORS[self.operator](cell, value)


class Statistics(NamedTuple):
    """Statistics of one measure in one group of scans."""

    group: tuple[Cell, ...]
    measure: str
    number: int
    left_out: int
    """Values that are not `ok`, and take no part."""
    mean: float | None
    """None where no value takes part, as are the percentiles."""
    sd: float | None
    """Of the sample; None for a single value."""
    percentiles: tuple[float | None, ...]
    """At `PERCENTILES`, interpolated linearly."""


def read_results(results: Path) -> ResultsTable:
    """Read the table of an archive, with a column `age_group` where ages are known.

    Raises
    ------
    RefusedInput
        There is none, or it is damaged.
    """
    from pyarrow import ArrowException, parquet

    file = results / PARQUET
    try:
        table = parquet.read_table(file)
    except FileNotFoundError:
        raise RefusedInput(file, "no such file, expected the table that 'footscan run' writes") from None
    except (OSError, ArrowException) as error:
        raise RefusedInput(file, f"is no table of results ({str(error).splitlines()[0][:80]})") from None
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema if field.metadata}
    rows: list[dict[str, Cell]] = table.to_pylist()
    columns = list(table.schema.names)
    if "age" in columns:
        columns.insert(columns.index("age") + 1, "age_group")
        for row in rows:
            row["age_group"] = _age_group(row["age"])
    return ResultsTable(columns, units, rows)


def known_column(name: str, table: ResultsTable, option: str) -> str:
    """The column that `name` means: the unit at its end may be left out; RefusedInput if there is none.

    >>> known_column("foot_length", ResultsTable(["foot_length_mm"], {}, []), "--columns")
    'foot_length_mm'
    """
    import difflib

    if name in table.columns:
        return name
    with_unit = [f"{name}_{unit}" for unit in UNITS if f"{name}_{unit}" in table.columns]
    if with_unit:
        return with_unit[0]
    near = difflib.get_close_matches(name, table.columns, n=1)
    hint = f", did you mean {near[0]!r}?" if near else ""
    raise RefusedInput(option, f"no column {name[:60]!r}{hint}")


def measures_of(table: ResultsTable) -> list[str]:
    """The columns of measures: those with a status beside them."""
    stems = {column.removesuffix(STATUS) for column in table.columns if column.endswith(STATUS)}
    return [column for column in table.columns if column in table.units and stem_of(column, table) in stems]


def stem_of(column: str, table: ResultsTable) -> str:
    """The name of a measure without its unit."""
    unit = table.units.get(column, "1")
    return column if unit == "1" else column.removesuffix(f"_{unit}")


def is_trusted(row: Row, column: str, table: ResultsTable) -> bool:
    """Return True if a value is `ok`, or is none of a measure."""
    return row.get(f"{stem_of(column, table)}{STATUS}", "ok") == "ok"


def select(table: ResultsTable, conditions: Iterable[Condition], sort: str | None) -> ResultsTable:
    """The rows that meet all conditions, sorted by a column; `-column` for the largest first. Empty cells come last."""
    conditions = list(conditions)
    rows = [row for row in table.rows if all(condition.holds(row) for condition in conditions)]
    if sort is not None:
        column = known_column(sort.removeprefix("-"), table, "--sort")
        filled = [row for row in rows if row.get(column) is not None]
        filled.sort(key=lambda row: row[column], reverse=sort.startswith("-"))  # type: ignore[arg-type,return-value]
        rows = [*filled, *(row for row in rows if row.get(column) is None)]
    return table._replace(rows=rows)


def statistics(
    table: ResultsTable, measures: Sequence[str], groups: Sequence[str], *, with_uncertain: bool = False
) -> list[Statistics]:
    """Statistics of measures in groups of rows with equal cells; values that are not `ok` are left out and counted."""
    keys = sorted(
        {tuple(row.get(name) for name in groups) for row in table.rows}, key=lambda key: [str(k) for k in key]
    )
    found = []
    for key in keys:
        rows = [row for row in table.rows if tuple(row.get(name) for name in groups) == key]
        for measure in measures:
            with_value = [row for row in rows if isinstance(row.get(measure), int | float)]
            used = [row for row in with_value if with_uncertain or is_trusted(row, measure, table)]
            left_out = len(with_value) - len(used)
            if not used:
                if with_value:
                    found.append(Statistics(key, measure, 0, left_out, None, None, (None,) * len(PERCENTILES)))
                continue
            values = np.array([row[measure] for row in used], np.float64)
            sd = float(values.std(ddof=1)) if len(values) > 1 else None
            percentiles = tuple(float(value) for value in np.percentile(values, PERCENTILES))
            found.append(Statistics(key, measure, len(used), left_out, float(values.mean()), sd, percentiles))
    return found


def _age_group(age: Cell) -> str | None:
    """The group of an age in years.

    >>> _age_group(34)
    '30-39'
    """
    if not isinstance(age, int):
        return None
    first = age // AGE_YEARS * AGE_YEARS
    return f"{first}-{first + AGE_YEARS - 1}"


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
