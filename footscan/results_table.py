"""Read the results of an archive as a table; `pipelines.archive.table` writes it."""

from pathlib import Path
from typing import TYPE_CHECKING

from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    import pyarrow


def results(folder: Path | str) -> "pyarrow.Table":
    """The results of an archive as a table, a row a scan; `.to_pandas()` and `.to_pydict()` lead on from there.

    Parameters
    ----------
    folder : the results of a workflow

    Raises
    ------
    RefusedInput
        There is no table yet.
    """
    from pyarrow import parquet

    table = Path(folder) / "results.parquet"
    if not table.is_file():
        raise RefusedInput(table, "no such file, expected the results of 'footscan run'")
    return parquet.read_table(table)
