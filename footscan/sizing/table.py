"""The table of sizes, widths and lasts: the one that comes along, or a user's edited copy."""

from pathlib import Path

from schemas.base.yaml_files import read_yaml
from schemas.sizes import SizeTable

TABLE = Path(__file__).with_name("sizes.yaml")


def read_table(file: Path | None = None) -> SizeTable:
    """The table in `file`, or the one that comes along.

    Raises
    ------
    RefusedInput
        It breaks the format; one line names file, field and expectation.
    """
    return read_yaml(file or TABLE, SizeTable)
