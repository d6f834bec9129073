"""CSV files of lasts."""

from pathlib import Path

import pytest

from footscan.sizing.last_files import read_lasts
from schemas.base.errors import RefusedInput

TABLE = """\
article,size,fullness,side,length_mm,ball_girth_mm,heel_girth_mm,heel_height_mm
Derby,41,F,left,273,240,330,20
Derby,41,F,right,273.5,240.5,,20

"Derby, low",42,G,,280,250,335,
"""


def lasts_in(folder: Path, text: str, name: str = "lasts.csv") -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder


def test_a_last_a_row(tmp_path: Path) -> None:
    left, right, low = read_lasts(lasts_in(tmp_path, TABLE))
    assert (left.name, left.side, left.heel_height_mm) == ("Derby 41 F", "left", 20.0)
    assert left.measures == {"length": 273.0, "ball_girth": 240.0, "heel_girth": 330.0}
    assert right.measures == {"length": 273.5, "ball_girth": 240.5}
    assert (low.name, low.article, low.size, low.fullness, low.side) == (
        "Derby, low 42 G",
        "Derby, low",
        "42",
        "G",
        "both",
    )
    assert low.heel_height_mm is None
    assert low.place == f"{tmp_path / 'lasts.csv'}: row 5"


def test_a_last_a_file_is_called_as_the_file(tmp_path: Path) -> None:
    lasts_in(tmp_path, "length_mm,ball_girth_mm\n280,250\n", "oxford.csv")
    (tmp_path / "below").mkdir()
    lasts_in(tmp_path / "below", "last,length_mm,ball_girth_mm\nB 1,270,240\n", "a.CSV")
    lasts_in(tmp_path, "no table", "readme.txt")
    assert [last.name for last in read_lasts(tmp_path)] == ["B 1", "oxford"]
    assert [last.name for last in read_lasts(tmp_path / "oxford.csv")] == ["oxford"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("273.5", "27.35", "row 3, column length_mm: expected mm from 80 to 450, found '27.35'"),
        ("240.5", "", "row 3, column ball_girth_mm: expected mm from 80 to 600, found ''"),
        ("240.5", "nan", "row 3, column ball_girth_mm: expected mm from 80 to 600, found 'nan'"),
        ("240.5", '"240,5"', "row 3, column ball_girth_mm: expected mm from 80 to 600, found '240,5'"),
        ("left", "links", "row 2, column side: expected left, right or both, found 'links'"),
        ("330,20", "330", "row 2: expected 8 cells, found 7"),
        ("heel_girth_mm", "heel_grith_mm", "row 1: unknown column 'heel_grith_mm', did you mean 'heel_girth_mm'?"),
        ("heel_girth_mm", "size", "row 1, column size: is listed twice, expected each column once"),
        ("ball_girth_mm", "waist_girth_mm", "row 1: column ball_girth_mm is missing, expected it in the header"),
        ("Derby,41,F,left", ",,,left", "row 2: has no name, expected one in column last, or an article"),
    ],
)
def test_a_bad_cell_is_named_in_one_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in TABLE
    with pytest.raises(RefusedInput) as caught:
        read_lasts(lasts_in(tmp_path, TABLE.replace(old, new, 1)))
    assert str(caught.value) == f"{tmp_path / 'lasts.csv'}: {said}"


@pytest.mark.parametrize(("cell", "said"), [(";", "';'"), ("\t", "tabs")])
def test_cells_parted_otherwise_are_seen(tmp_path: Path, cell: str, said: str) -> None:
    expected = f"row 1: cells are separated by {said}, expected ',' between them and a decimal point in numbers"
    with pytest.raises(RefusedInput, match=f"{expected}$"):
        read_lasts(lasts_in(tmp_path, TABLE.replace(",", cell)))


def test_a_last_that_stands_twice_is_refused(tmp_path: Path) -> None:
    lasts_in(tmp_path, TABLE, "a.csv")
    lasts_in(tmp_path, TABLE.replace(",left,", ",right,", 1), "b.csv")
    with pytest.raises(RefusedInput) as caught:
        read_lasts(tmp_path)
    twice, first = (f"{tmp_path / name}: row {row}" for name, row in (("b.csv", 2), ("a.csv", 3)))
    assert str(caught.value) == f"{twice}: last 'Derby 41 F' is listed in {first} already, expected once"


def test_a_folder_without_lasts_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RefusedInput, match=r"no lasts here, expected CSV files with one last per row$"):
        read_lasts(tmp_path)
    with pytest.raises(RefusedInput, match="row 1: column length_mm is missing, expected it in the header"):
        read_lasts(lasts_in(tmp_path, "\n"))
    with pytest.raises(RefusedInput, match="no lasts here"):
        read_lasts(lasts_in(tmp_path, "last,length_mm,ball_girth_mm\n"))
    with pytest.raises(RefusedInput, match="no such folder"):
        read_lasts(tmp_path / "nowhere")
