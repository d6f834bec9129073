"""`footscan extract`: what it writes, prints and refuses."""

import csv
import json
import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from pipelines.cli.main import run_command
from schemas.base.errors import Fault
from schemas.parameters.extraction import ExtractionParameters

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
    named = {"file": str(frame), "background": None, "out": str(out), "overlay": str(overlay)}
    counted = {"frames": 1, "lost": [], "points": len(j), "points_per_frame": [len(j)]}
    assert {name: found[name] for name in (*named, *counted)} == named | counted
    assert found["median_width_px"] == pytest.approx(2.355 * 2.0, rel=0.1)  # of a Gaussian, and a smoothed frame
    assert 0.02 <= found["median_sigma_px"] < 0.1
    assert told == [f"{frame}: {len(j)} stripe points in 1 frame; laser: red"]
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
    background = background if frames == 1 else background.parent
    status, printed, _ = extract(film, "--background", background, "--out", out, "--json")
    assert (status, json.loads(printed)["background"]) == (0, str(background))
    found = centres(out)
    assert list(found) == [0, 1, 2]
    for number, j in found.items():
        assert len(j) > 0.9 * COLUMNS
        np.testing.assert_allclose(j, STRIPE + number, atol=0.2)


def test_a_parameter_is_heeded(extract: Extract, frame: Path) -> None:
    found = json.loads(extract(frame, "--set", "red_threshold=22", "--set", "gap_px=2.5", "--json")[1])
    assert found["points"] > 0
    assert found["parameters"] == ExtractionParameters(red_threshold=22, gap_px=2.5).model_dump()
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
        (["gap_px=2", "gap_px=3"], "--set: gap_px: is listed twice, expected each parameter once"),
        (["faintest_contrast=13"], "--set: faintest_contrast: expected at most smallest_contrast, 12, found 13"),
        (["smallest_contrast=5.5"], "--set: faintest_contrast: expected at most smallest_contrast, 5.5, found 6"),
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
    both = tmp_path / "both.png"
    (tmp_path / "points.csv").symlink_to(both)
    told = "stands for two outputs, expected a file for each"
    refused(extract(frame, "--out", tmp_path / "points.csv", "--overlay", both), f"{both}: {told}")
    assert {file: file.read_bytes() for file in tmp_path.rglob("*.png")} == before
    assert not both.exists()


@pytest.mark.parametrize("name", ["frame.png", "frame.jpg"])
def test_a_picture_that_is_torn_is_refused(extract: Extract, frame: Path, tmp_path: Path, name: str) -> None:
    torn = tmp_path / f"torn-{name}"
    with Image.open(frame) as picture:
        picture.save(torn)
    torn.write_bytes(torn.read_bytes()[: torn.stat().st_size // 2])
    before = sorted(tmp_path.iterdir())
    written = "--out", tmp_path / "points.csv", "--overlay", tmp_path / "overlay.png"
    refused(extract(torn, *written, "--json"), f"{torn}: expected a whole image, found one that is torn")
    assert sorted(tmp_path.iterdir()) == before


def tear(frame: Path) -> None:
    frame.write_bytes(frame.read_bytes()[:60])


def test_lost_frames_are_told(extract: Extract, film: Path, tmp_path: Path) -> None:
    whole = json.loads(extract(film, "--json")[1])["points_per_frame"]
    assert len(whole) == 3
    assert min(whole) > 0.9 * COLUMNS
    tear(film / "1.png")
    status, printed, told = extract(film, "--overlay", tmp_path / "overlay.png", "--json")
    found = json.loads(printed)
    assert (status, found["frames"], found["lost"]) == (0, 3, [1])
    assert found["points_per_frame"] == [whole[0], 0, whole[2]]
    assert told == [f"{film}: {whole[0] + whole[2]} stripe points in 2 of 3 frames, 1 lost; laser: red"]


def test_a_folder_of_lost_frames(extract: Extract, film: Path, tmp_path: Path) -> None:
    for frame in film.iterdir():
        tear(frame)
    status, printed, told = extract(film, "--overlay", tmp_path / "overlay.png", "--json")
    found = json.loads(printed)
    assert (status, found["lost"], found["points_per_frame"]) == (0, [0, 1, 2], [0, 0, 0])
    assert found["median_width_px"] is found["median_sigma_px"] is None
    assert told == [f"{film}: 0 stripe points in 3 frames, 3 lost"]


def test_a_torn_frame_alone_in_its_folder_is_a_lost_one(extract: Extract, frame: Path) -> None:
    tear(frame)
    status, _, told = extract(frame.parent)
    assert (status, told) == (0, [f"{frame.parent}: 0 stripe points in 1 frame, 1 lost"])


@pytest.mark.parametrize("option", ["--out", "--overlay"])
def test_a_target_that_cannot_be_made_is_refused_at_once(
    extract: Extract, frame: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, option: str
) -> None:
    monkeypatch.setattr("footscan.stripe.film.extract_film", lambda *_: pytest.fail("extracted before the check"))
    target = tmp_path / "notes" / "deeper" / ("points.csv" if option == "--out" else "overlay.png")
    target.parents[1].write_text("no folder")
    refused(extract(frame, option, target), f"{target}: cannot be written ({target.parents[1]}: Not a directory)")
    assert target.parents[1].read_text() == "no folder"
    round_about = tmp_path / f"circle{target.suffix}"
    round_about.symlink_to(round_about)
    refused(extract(frame, option, round_about), f"{round_about}: cannot be written (")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_may_not_be_written_is_refused_at_once(extract: Extract, frame: Path, tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir(mode=0o500)
    overlay = tmp_path / "kept/overlay.png"
    refused(extract(frame, "--overlay", overlay), f"{overlay}: cannot be written ({tmp_path}/kept: Permission denied)")


def test_nothing_is_printed_if_the_overlay_cannot_be_drawn(
    extract: Extract, frame: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> bytes:
        raise Fault("out of ink")

    monkeypatch.setattr("footscan.report.scan.stripe_figure.frame_figure", fail)
    assert extract(frame, "--overlay", tmp_path / "overlay.png") == (3, "", ["footscan: out of ink"])


def test_a_new_folder_is_made_for_the_targets(extract: Extract, frame: Path, tmp_path: Path) -> None:
    new = tmp_path / "new" / "folder"
    assert extract(frame, "--out", new / "points.CSV", "--overlay", new / "overlay.PNG")[0] == 0
    assert sorted(file.name for file in new.iterdir()) == ["overlay.PNG", "points.CSV"]


def test_wrong_endings(extract: Extract, frame: Path, tmp_path: Path) -> None:
    for option, name, expected, found in (
        ("--overlay", "overlay.csv", ".png", ".csv"),
        ("--overlay", "overlay.jpg", ".png", ".jpg"),
        ("--overlay", "overlay", ".png", ""),
        ("--out", "points.png", ".csv", ".png"),
        ("--out", "points.json", ".csv", ".json"),
    ):
        target = tmp_path / name
        refused(extract(frame, option, target), f"{target}: expected a file that ends in {expected}, found {found!r}")
    assert list(tmp_path.iterdir()) == [frame]


def test_points_into_a_pipe(extract: Extract, frame: Path, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.of.any.name"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        status, printed, _ = extract(frame, "--out", pipe)
        assert (status, printed) == (0, "")
        assert os.read(reader, 1 << 16).decode() == extract(frame)[1]  # a pipe takes in 64 KB unread
    finally:
        os.close(reader)
    assert pipe.is_fifo()


def test_points_into_an_open_file_descriptor(extract: Extract, frame: Path) -> None:
    """As /dev/stdout is one, whatever the shell has made of it."""
    read, write = os.pipe()
    try:
        assert extract(frame, "--out", f"/dev/fd/{write}")[:2] == (0, "")
        assert os.read(read, 1 << 16).decode() == extract(frame)[1]
    finally:
        os.close(read)
        os.close(write)


@pytest.mark.parametrize("name", ["FILE", "--out", "--overlay", "--background"])
def test_an_empty_path_is_refused(
    extract: Extract, frame: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)  # a folder with an image, which '' must not mean
    refused(extract(*([""] if name == "FILE" else [frame, name, ""])), f"{name}: expected a path, found ''")
    assert list(tmp_path.iterdir()) == [frame]


@pytest.mark.parametrize("mode", ["L", "RGB"])
@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_a_picture_without_colour_is_told(
    extract: Extract, frame: Path, tmp_path: Path, mode: str, suffix: str
) -> None:
    grey = tmp_path / f"grey{suffix}"
    with Image.open(frame) as picture:
        picture.convert("L").convert(mode).save(grey)
    assert re.fullmatch(rf"{grey}: 1\d\d stripe points in 1 frame; laser: mono", extract(grey)[2][0])
    status, _, told = extract(grey, "--set", "laser=red")
    why = "laser: red; it has no colour (R = G = B in every pixel), so that no red stripe can be found in it"
    assert (status, told) == (0, [f"{grey}: 0 stripe points in 1 frame; {why}"])
    bright = 90 + 150 * np.exp(-0.5 * ((np.mgrid[0:ROWS, 0:COLUMNS][0] - STRIPE) / 2.0) ** 2)
    Image.fromarray(np.rint(bright).astype(np.uint8)).convert(mode).save(grey)
    told = extract(grey, "--set", "saturation=100", "--set", "laser=red")[2]
    assert told[0].endswith("it has no colour (R = G = B in every pixel), so that what was found is bright, not red")
    assert "no colour" not in extract(frame, "--set", "red_threshold=254")[2][0]


def test_the_overlay_says_what_it_is_of(
    extract: Extract, frame: Path, film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[object] = []

    def keep(*arguments: object) -> bytes:
        said.append(arguments[-1])
        return b""

    monkeypatch.setattr("footscan.report.scan.stripe_figure.frame_figure", keep)
    monkeypatch.setattr("footscan.report.scan.stripe_figure.film_figure", keep)
    overlay = "--overlay", tmp_path / "overlay.png"
    off = write(tmp_path / "off.png", RED_THING)
    extract(frame, *overlay)
    extract(frame, *overlay, "--background", off, "--set", "gap_px=2.5", "--set", "red_threshold=18")
    extract(film, *overlay, "--set", "centre_method=fir", "--set", "red_threshold=20")
    assert said == [
        "frame.png",
        "frame.png, background off.png, gap_px=2.5",
        "film, red_threshold=20, centre_method=fir",
    ]
