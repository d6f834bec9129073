"""`footscan extract`: what it writes, prints and refuses."""

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from pipelines.cli.main import run_command

ROWS, COLUMNS = 120, 160
STRIPE, RED_THING = 70.0, 25.0
"""Rows of the stripe, and of a red line that is there without the laser, too."""
Extract = Callable[..., tuple[int, str, list[str]]]


@pytest.fixture
def extract(capsys: pytest.CaptureFixture[str]) -> Extract:
    """Exit status, standard output and the lines of standard error of `footscan extract ARGUMENTS`."""

    def run(*arguments: object) -> tuple[int, str, list[str]]:
        capsys.readouterr()
        status = run_command(["extract", *map(str, arguments)])
        said = capsys.readouterr()
        return status, said.out, said.err.splitlines()

    return run


def light(row: float) -> NDArray[np.float64]:
    """A line of light along a row, in red with some green and blue."""
    profile = 180 * np.exp(-0.5 * ((np.arange(ROWS) - row) / 2.0) ** 2)
    return np.repeat(profile[:, np.newaxis], COLUMNS, axis=1)[..., np.newaxis] * [1.0, 0.12, 0.1]


def write(file: Path, *rows: float, size: tuple[int, int] = (ROWS, COLUMNS)) -> Path:
    """A frame with lines of light, as PNG."""
    file.parent.mkdir(exist_ok=True)
    image = 20 + sum((light(row) for row in rows), np.zeros((ROWS, COLUMNS, 3)))
    Image.fromarray(np.clip(image, 0, 255).astype(np.uint8)[: size[0], : size[1]]).save(file)
    return file


@pytest.fixture
def frame(tmp_path: Path) -> Path:
    return write(tmp_path / "frame.png", STRIPE)


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """A folder of three frames: the stripe moves by a pixel, a red thing stands still."""
    for number in range(3):
        write(tmp_path / "film" / f"{number}.png", STRIPE + number, RED_THING)
    return tmp_path / "film"


def centres(file: Path) -> dict[int, NDArray[np.float64]]:
    """Rows of the points of each frame of a CSV."""
    with file.open(newline="") as text:
        rows = list(csv.DictReader(text))
    numbers = np.array([int(row["frame"]) for row in rows], int)
    j = np.array([float(row["j"]) for row in rows])
    return {number: j[numbers == number] for number in np.unique(numbers).tolist()}


def test_one_picture(extract: Extract, frame: Path, tmp_path: Path) -> None:
    out, overlay = tmp_path / "points.csv", tmp_path / "overlay.png"
    status, printed, told = extract(frame, "--out", out, "--overlay", overlay, "--json")
    assert status == 0
    found = json.loads(printed)
    j = centres(out)[0]
    assert found == {"file": str(frame), "frames": 1, "points": len(j), "out": str(out), "overlay": str(overlay)}
    assert told == [f"{frame}: {len(j)} stripe points in 1 frame"]
    assert len(j) > 0.9 * COLUMNS
    np.testing.assert_allclose(j, STRIPE, atol=0.1)
    with Image.open(overlay) as picture:
        assert picture.format == "PNG"
        assert min(picture.size) > 500


def test_points_on_standard_output(extract: Extract, frame: Path, tmp_path: Path) -> None:
    extract(frame, "--out", tmp_path / "points.csv")
    assert extract(frame)[1] == (tmp_path / "points.csv").read_text()
    assert json.loads(extract(frame, "--json")[1])["overlay"] is None


def test_the_overlay_of_a_film_shows_its_frames(extract: Extract, film: Path, tmp_path: Path) -> None:
    status, printed, _ = extract(film, "--overlay", tmp_path / "film.png", "--json")
    assert status == 0
    assert json.loads(printed)["frames"] == 3
    extract(film / "0.png", "--overlay", tmp_path / "frame.png")
    with Image.open(tmp_path / "film.png") as of_film, Image.open(tmp_path / "frame.png") as of_frame:
        assert of_film.size != of_frame.size


@pytest.mark.parametrize("frames", [1, 3])
def test_a_background_takes_away_what_is_there_without_the_laser(
    extract: Extract, film: Path, tmp_path: Path, frames: int
) -> None:
    out = tmp_path / "points.csv"
    extract(film, "--out", out)
    assert all(np.any(np.abs(j - RED_THING) < 1) for j in centres(out).values())
    for number in range(frames):
        background = write(tmp_path / "off" / f"{number}.png", RED_THING)
    status, _, _ = extract(film, "--background", background if frames == 1 else tmp_path / "off", "--out", out)
    assert status == 0
    found = centres(out)
    assert list(found) == [0, 1, 2]
    for number, j in found.items():
        assert len(j) > 0.9 * COLUMNS
        np.testing.assert_allclose(j, STRIPE + number, atol=0.2)


def test_a_parameter_is_heeded(extract: Extract, frame: Path) -> None:
    assert json.loads(extract(frame, "--set", "red_threshold=22", "--set", "gap_px=2.5", "--json")[1])["points"] > 0
    assert json.loads(extract(frame, "--set", "red_threshold=254", "--json")[1])["points"] == 0


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (["red_treshold=22"], "--set: red_treshold: unknown field, did you mean 'red_threshold'?"),
        (["red_threshold=255"], "--set: red_threshold: input should be less than or equal to 254, found '255'"),
        (["red_threshold=nan"], "--set: red_threshold: input should be a valid integer"),
        (["red_threshold="], "--set: red_threshold: input should be a valid integer"),
        (["red_threshold"], "--set: expected NAME=VALUE, found 'red_threshold'"),
        (["=22"], "--set: expected NAME=VALUE, found '=22'"),
        (["gap_px=2", "gap_px=3"], "--set: gap_px: stands twice, expected each parameter once"),
    ],
)
def test_wrong_parameters(extract: Extract, frame: Path, tmp_path: Path, settings: list[str], told: str) -> None:
    options = [part for setting in settings for part in ("--set", setting)]
    refused(extract(frame, *options, "--out", tmp_path / "points.csv"), told)
    assert sorted(tmp_path.iterdir()) == [frame]


def refused(done: tuple[int, str, list[str]], told: str) -> None:
    status, printed, lines = done
    assert (status, printed, len(lines)) == (2, "", 1)
    assert lines[0].startswith(f"footscan: {told}")


def test_wrong_backgrounds(extract: Extract, frame: Path, film: Path, tmp_path: Path) -> None:
    missing = tmp_path / "off.png"
    refused(extract(frame, "--background", missing), f"{missing}: no such film")
    small = write(tmp_path / "small.png", size=(100, 90))
    expected = f"frame size: expected frames of {COLUMNS} x {ROWS} pixels, found 90 x 100"
    refused(extract(frame, "--background", small), f"{small}: {expected}")
    expected = "frames: expected one frame or 1, as many as"
    refused(extract(frame, "--background", film), f"{film}: {expected} {frame} has, found 3")
    torn = tmp_path / "torn.png"
    torn.write_bytes(frame.read_bytes()[:60])
    expected = "frames: expected a whole frame, found one that is torn"
    refused(extract(film, "--background", torn), f"{torn}: {expected}")


def test_a_missing_file(extract: Extract, tmp_path: Path) -> None:
    refused(extract(tmp_path / "frame.png", "--overlay", tmp_path / "o.png"), f"{tmp_path / 'frame.png'}: no such film")
    assert list(tmp_path.iterdir()) == []


def test_inputs_are_kept(extract: Extract, frame: Path, film: Path, tmp_path: Path) -> None:
    off = write(tmp_path / "off.png")
    before = {file: file.read_bytes() for file in tmp_path.rglob("*.png")}
    told = "is an input, expected another file to write"
    for option in ("--out", "--overlay"):
        refused(extract(frame, option, frame), f"{frame}: {told}")
        refused(extract(frame, "--background", off, option, off), f"{off}: {told}")
        refused(extract(film, option, film / "1.png"), f"{film / '1.png'}: {told}")
        refused(extract(film, option, film), f"{film}: is a folder, expected the name of a file to write")
    overlay = film / "overlay.png"
    refused(extract(film, "--overlay", overlay), f"{overlay}: lies among the frames, expected a file in another folder")
    both = tmp_path / "both"
    told = "is the file of --out, expected another file to write"
    refused(extract(frame, "--out", both, "--overlay", both), f"{both}: {told}")
    assert {file: file.read_bytes() for file in tmp_path.rglob("*.png")} == before
    assert not both.exists()


def test_a_picture_that_is_torn_has_no_stripe(extract: Extract, frame: Path, tmp_path: Path) -> None:
    frame.write_bytes(frame.read_bytes()[:60])
    status, printed, _ = extract(frame, "--overlay", tmp_path / "overlay.png", "--json")
    assert (status, json.loads(printed)["points"]) == (0, 0)
    with Image.open(tmp_path / "overlay.png") as picture:
        assert min(picture.size) > 500
