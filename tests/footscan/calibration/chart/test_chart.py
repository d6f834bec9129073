"""Reading of calibration charts: what the format allows is taken, what breaks it is refused in one line."""

from pathlib import Path

import numpy as np
import pytest

from footscan.calibration.chart.chart import read_chart
from footscan.thesis.printed import printed_charts
from schemas.base.errors import RefusedInput

DATA = Path(__file__).parent / "data"
HEADER = "camera,point,x_mm,y_mm,z_mm,i,j\n"


def write(folder: Path, text: str | bytes) -> Path:
    path = folder / "chart.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_thesis_chart() -> None:
    charts = printed_charts()
    assert list(charts) == [1, 2, 3, 4, 5, 6, 7, 8]
    assert all(chart.unit == "cm" and chart.points == ("P1", "P2", "P3", "P4", "P5") for chart in charts.values())
    np.testing.assert_array_equal(charts[8].world[3], [0, -5, 3])
    np.testing.assert_array_equal(charts[8].pixels[3], [143, 132])


def test_tolerates_order_spaces_mark_and_blank_lines(tmp_path: Path) -> None:
    text = "\ufeff j , i,camera, point,z_mm,y_mm,x_mm\r\n\r\n 2.5,1e1 , 3, A b ,-.5,+4,0\r\n  \r\n,,,,,,\r\n"
    charts = read_chart(write(tmp_path, text))
    assert list(charts) == [3]
    assert charts[3].points == ("A b",)
    assert charts[3].unit == "mm"
    np.testing.assert_array_equal(charts[3].world, [[0, 4, -0.5]])
    np.testing.assert_array_equal(charts[3].pixels, [[10, 2.5]])


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "is empty"),
        ("\n \n", "is empty"),
        (HEADER, "no control point"),
        ("camera,point,x_mm,y_mm,i,j\n1,A,0,0,0,0\n", "line 1, column z_mm: is missing"),
        ("camera,point,i,j\n1,A,0,0\n", "column x_mm: is missing, expected camera,point,x_cm"),
        ("camera,point,x_mm,y_cm,z_mm,i,j\n", "mixes cm and mm"),
        ("camera,point,x_mm,y_mm,z_mm,i,j,k\n", "line 1, column k: unknown column"),
        ("camera,point,x_mm,y_mm,z_mm,i,i,j\n", "column i: is listed twice"),
        ("camera;point;x_mm;y_mm;z_mm;i;j\n", "one column, expected camera,point"),
        (HEADER + "1,A,0,0,0,1,2\n1,B,0,zero,0,1,2\n", "line 3, column y_mm: expected a number"),
        (HEADER + "1,A,0,0,0,nan,2\n", "line 2, column i"),
        (HEADER + "1,A,0,0,0,1,inf\n", "line 2, column j"),
        (HEADER + "1,A,0,0,0,1,1e400\n", "line 2, column j"),
        (HEADER + "1,A,0,0,0,1,1_0\n", "line 2, column j"),
        (HEADER + "1,A,0,0,0,1,\n", "line 2, column j"),
        (HEADER + "0,A,0,0,0,1,2\n", "line 2, column camera: expected a whole number from 1, found '0'"),
        (HEADER + "1.5,A,0,0,0,1,2\n", "line 2, column camera"),
        (HEADER + "-1,A,0,0,0,1,2\n", "line 2, column camera"),
        (HEADER + "²,A,0,0,0,1,2\n", "line 2, column camera"),
        (HEADER + "1,,0,0,0,1,2\n", "line 2, column point: expected a name"),
        (HEADER + "1,A,0,0,0,1\n", "line 2: expected 7 values"),
        (HEADER + "1,A,0,5,0,0,1,2\n", "line 2: expected 7 values"),
        (HEADER + "1,A,0,0,0,1,2\n2,A,0,0,0,1,2\n1,A,0,0,0,1,2\n", "line 4, column point: camera 1 has 'A' in line 2"),
        (HEADER + '1,"A,0,0,0,1,2\n', "expected a CSV file"),
        (b"camera,point\xff", "expected a CSV file in UTF-8"),
    ],
)
def test_refuses(tmp_path: Path, text: str | bytes, named: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(RefusedInput) as caught:
        read_chart(path)
    assert str(path) in str(caught.value)
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_refuses_what_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(RefusedInput, match="no such file"):
        read_chart(tmp_path / "absent.csv")
    with pytest.raises(RefusedInput, match="expected a file"):
        read_chart(tmp_path)


def test_the_size_of_the_images(tmp_path: Path) -> None:
    path = tmp_path / "chart.csv"
    head = "camera,point,x_mm,y_mm,z_mm,i,j,width_px,height_px\n"
    path.write_text(head + "1,a,0,1,2,900,700,1280,720\n2,a,0,1,2,3,4,640,480\n1,b,0,1,3,3,4,1280,720\n")
    assert {camera: chart.size.px for camera, chart in read_chart(path).items()} == {1: (1280, 720), 2: (640, 480)}


@pytest.mark.parametrize(
    ("rows", "problem"),
    [
        (
            "1,a,0,1,2,3,4,1280,720\n1,b,0,1,3,3,4,640,480\n",
            "line 3, column width_px: camera 1 has images of 1280 x 720",
        ),
        ("1,a,0,1,2,3,4,300,720\n", "line 2, column width_px: expected a whole number from 320 to 16384, found '300'"),
        ("1,a,0,1,2,3,4,640,480.5\n", "line 2, column height_px: expected a whole number from 240 to 16384"),
    ],
)
def test_sizes_that_no_camera_has(tmp_path: Path, rows: str, problem: str) -> None:
    path = tmp_path / "chart.csv"
    path.write_text("camera,point,x_mm,y_mm,z_mm,i,j,width_px,height_px\n" + rows)
    with pytest.raises(RefusedInput, match=problem):
        read_chart(path)


def test_a_camera_that_sees_two_lasers(tmp_path: Path) -> None:
    path = tmp_path / "chart.csv"
    head = "camera,point,x_mm,y_mm,z_mm,i,j,laser\n"
    path.write_text(head + "5,a,0,1,2,3,4,1\n5,a,12,1,2,30,4,2\n6,a,0,1,2,3,4,1\n")
    charts = read_chart(path)
    assert {view: (chart.camera, chart.laser, chart.name) for view, chart in charts.items()} == {
        5: (5, 1, "5"),
        6: (6, 1, "6"),
        69: (5, 2, "5 (laser 2)"),
    }
    assert charts[69].world.tolist() == [[12.0, 1.0, 2.0]]
    for row, problem in (
        ("5,a,0,1,2,3,4,3", "column laser: expected a whole number from 1 to 2"),
        ("65,a,0,1,2,3,4,1", "column camera: expected a whole number from 1 to 64"),
    ):
        path.write_text(head + row + "\n")
        with pytest.raises(RefusedInput, match=problem):
            read_chart(path)


def test_one_side_alone_is_no_size(tmp_path: Path) -> None:
    path = tmp_path / "chart.csv"
    path.write_text("camera,point,x_mm,y_mm,z_mm,i,j,width_px\n1,a,0,1,2,3,4,1280\n")
    with pytest.raises(RefusedInput, match="line 1, column height_px: is missing"):
        read_chart(path)
