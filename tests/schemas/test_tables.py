"""CSV that a spreadsheet shows and does not compute."""

import csv
import io
from pathlib import Path

import pytest

from schemas.tables import csv_text, plain_cell, read_records

FORMULAS = [
    "=1+1",
    '=HYPERLINK("http://a","b")',
    "+1+1",
    "-1+1",
    "@SUM(1)",
    "\t=1",
    "\tx",
    "\rx",
    "\n=1",
    "  =1",
    "\u00a0=1",
    "\ufeff=1",
    "\u200b@x",
    "\x00=1",
    "\u202e=1",
    "＝1+1",
    "＋1",
    "－1",
    "＠x",
    "\u22121",
    "-",
    "-1_000",
    "-inf",
    "=-1.5",
]


@pytest.mark.parametrize("cell", FORMULAS)
def test_formulas_become_text(cell: str) -> None:
    text = "'" + cell.replace("\r", "\n")
    assert plain_cell(cell) == text
    assert plain_cell(text) == text
    [[read]] = csv.reader(io.StringIO(csv_text([[cell]]), newline=""))
    assert read == text


@pytest.mark.parametrize(
    "cell", ["", "P0001/S1", "a=1", "x-1", "-1.5", "+2", "-.5e-3", "cam3.avi: -5", "'=1", "../-x", "/=", -1.5, 7, None]
)
def test_numbers_and_words_stay(cell: str | float | None) -> None:
    assert plain_cell(cell) == cell


def test_a_cell_cannot_end_its_row() -> None:
    text = csv_text([["a\r=1", 'b"\n=2', "c,=3", "d\r\n=4"]])
    assert list(csv.reader(io.StringIO(text, newline=""))) == [["a\n=1", 'b"\n=2', "c,=3", "d\n=4"]]
    assert "\r" not in text


def test_rows_are_read_back(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(csv_text([["file", "y_mm"], ["=a.stl", -1.5], ["b, of today", None]]), encoding="utf-8")
    assert [cells for _, cells in read_records(path)] == [["file", "y_mm"], ["'=a.stl", "-1.5"], ["b, of today", ""]]
