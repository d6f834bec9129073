"""The table of sizes, widths and lasts: the built-in one, or an edited copy of it."""

from pathlib import Path

from schemas.base.yaml_files import read_yaml
from schemas.sizes import SizeTable

TABLE = Path(__file__).with_name("sizes.yaml")


def read_table(file: Path | None = None) -> SizeTable:
    """Read the table in `file`, or the built-in one.

    Raises
    ------
    RefusedInput
        The file breaks the format; the message names file, field and expectation in one line.
    """
    return read_yaml(file or TABLE, SizeTable)
