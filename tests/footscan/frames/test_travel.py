"""X of each frame."""

from pathlib import Path

import numpy as np
import pytest

from footscan.frames.travel import read_positions, travelled
from schemas.base.errors import RefusedInput
from schemas.scan import Travel


def test_even_travel() -> None:
    x = travelled(Travel(start_mm=-1.5, step_mm=2.0), 4)
    np.testing.assert_array_equal(x, [-1.5, 0.5, 2.5, 4.5])
    assert len(travelled(Travel(start_mm=0, step_mm=1), 0)) == 0


@pytest.mark.parametrize(
    "text",
    [
        "frame,x_mm\n0,1.5\n3,4\n1,-2e0\n",
        "x_mm,frame\r\n1.5,0\r\n4,3\r\n-2.0,1\r\n",
        "\ufeffframe, x_mm\n\n0, 1.5\n1 , -2\n3,+4.000\n",
    ],
)
def test_uneven_travel(tmp_path: Path, text: str) -> None:
    path = tmp_path / "cam3.csv"
    path.write_text(text, newline="")
    np.testing.assert_array_equal(read_positions(path), [1.5, -2.0, np.nan, 4.0])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "expected the columns frame,x_mm, found ''"),
        ("0,1\n1,2\n", "expected the columns frame,x_mm, found '0,1'"),
        ("frame;x_mm\n0;1\n", "expected the columns frame,x_mm, found 'frame;x_mm'"),
        ("frame,x_mm,frame\n0,1,2\n", "expected the columns frame,x_mm, found 'frame,x_mm,frame'"),
        ("frame,x_cm\n0,1\n", "expected the columns frame,x_mm, found 'frame,x_cm'"),
        ("frame,x_mm\n", "expected a row for each frame, found none"),
        ("frame,x_mm\n0,1\n1,2\n0,1\n", "line 4: frame 0 is given twice"),
        *[
            (f"frame,x_mm\n0,1\n{row}\n", "line 3: expected a frame number from 0 and x_mm in millimetres")
            for row in (
                "one,2", "1,two", "-1,2", "1.0,2", ",2", "1,", "1", "1,nan", "1,inf", "1,-1e999", "1,2,5", "1,2 mm",
                "1,1e6", "\u0661,2", "9999999999999999,2",
            )
        ],
    ],
)  # fmt: skip
def test_broken_positions_are_refused(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "cam3.csv"
    path.write_text(text)
    with pytest.raises(RefusedInput) as caught:
        read_positions(path)
    assert str(caught.value) == f"{path}: {expected}"


def test_what_is_no_csv_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cam3.csv"
    with pytest.raises(RefusedInput, match=r"cam3\.csv: no such file$"):
        read_positions(path)
    with pytest.raises(RefusedInput, match="expected a file"):
        read_positions(tmp_path)
    for data in (b"frame,x_mm\n0,\xff\n", b'frame,x_mm\n0,"' + b"1" * 200_000):
        path.write_bytes(data)
        with pytest.raises(RefusedInput, match="expected a CSV file"):
            read_positions(path)
