"""Backgrounds: the effects of a camera's laser-off frames."""

import json
import shutil
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simplejpeg
from numpy.typing import NDArray

from footscan.frames.film import open_film
from footscan.frames.image import encode_png
from footscan.frames.ingest import ingest_film
from footscan.frames.reader import pixel_frames
from footscan.mesh.formats.files import read_file
from footscan.recordings.scans import read_scan
from footscan.virtual.filming.film import write_film
from pipelines.archive.ingest import ingest_scans
from pipelines.arrays import unpack
from pipelines.engine.files.file_digests import FileDigests
from pipelines.scan import CalibrationFile, scan_steps
from pipelines.steps import extract
from pipelines.steps.ingest_background import ingest_background
from schemas.base.errors import Fault, RefusedInput
from schemas.calibration import Calibration
from schemas.frames import FrameManifest
from schemas.parameters.extraction import ExtractionParameters
from schemas.parameters.scan import ScanParameters
from tests.helpers.stored_frames import frame_bytes, put_frame

Image = NDArray[np.uint8]
FRAMES = 20
LEFT_OF_THE_BAR = 130
"""Column; the bar's stripe lies to the right of it in every frame."""


def surroundings(column: int) -> Image:
    """A red line down a dark room, as bright and as wide as a stripe."""
    light = 150 * np.exp(-0.5 * ((np.arange(640) - column) / 1.8) ** 2) * np.ones((480, 1))
    light[:60], light[420:] = 0, 0
    return np.clip(light[..., None] * [1.0, 0.12, 0.1] + 20, 0, 255).astype(np.uint8)


def jpeg(image: Image) -> bytes:
    return bytes(simplejpeg.encode_jpeg(image, 95, "RGB", "444"))


def name_background(archive: Any, name: str) -> Path:
    """`name` as the background of camera 5; its path."""
    document = archive.scan / "scan.yaml"
    document.write_text(document.read_text().replace("cam5.avi", f"cam5.avi, background: {name}"))
    return Path(archive.scan / name)


def write_background(path: Path, images: list[Image]) -> None:
    """A film, a folder of pictures or a picture, by the name."""
    if path.suffix == ".avi":
        write_film(path, [jpeg(image) for image in images], 640, 480, 18)
    elif path.suffix == ".png":
        [image] = images
        path.write_bytes(encode_png(image))
    else:
        path.mkdir()
        for number, image in enumerate(images):
            (path / f"{number:03}.jpg").write_bytes(jpeg(image))


@pytest.fixture
def film_camera_5(archive: Any) -> Callable[[list[Image]], Path]:
    """Films camera 5's bar anew, before these surroundings; the film."""

    def film(behind: list[Image]) -> Path:
        path = Path(archive.scan / "cam5.avi")
        bar = [frame.copy() for frame in pixel_frames(open_film(path)) if frame is not None]
        write_film(path, [jpeg(np.maximum(*both)) for both in zip(bar, behind, strict=True)], 640, 480, 18)
        return path

    return film


def stripe(film: Path, background: Path | None, folder: Path) -> NDArray[Any]:
    """The stripe points of a film, by way of the frames that are kept of it."""
    manifest = ingest_film(film, folder / "frames.zarr/cam5")
    inputs = {"manifest": manifest.model_dump_json().encode()}
    places = {"array": folder / "frames.zarr/cam5"}
    if background is not None:
        places["background"] = folder / "frames.zarr/cam5-background"
        kept = ingest_background(background, places["background"], len(manifest.frames), manifest.size)
        inputs["background"] = kept.model_dump_json().encode()
    return unpack(extract.run(inputs, ExtractionParameters(), places))["stripe"]


@pytest.mark.parametrize("name", ["off.avi", "off", "off.png", "one.avi", "one"])
def test_what_is_there_without_the_laser_is_no_stripe(
    film_camera_5: Callable[[list[Image]], Path], tmp_path: Path, name: str
) -> None:
    one_for_each = name in {"off.avi", "off"}
    behind = [surroundings(40 + 4 * frame * one_for_each) for frame in range(FRAMES)]
    film = film_camera_5(behind)
    write_background(tmp_path / name, behind if one_for_each else behind[:1])
    without = stripe(film, None, tmp_path)
    points = stripe(film, tmp_path / name, tmp_path)
    clutter = np.count_nonzero(without["i"] < LEFT_OF_THE_BAR)
    assert clutter > 0.9 * 360 * FRAMES
    assert np.count_nonzero(points["i"] < LEFT_OF_THE_BAR) == 0
    assert len(points) == pytest.approx(len(without) - clutter, rel=0.02)
    assert set(points["frame"]) == set(range(FRAMES))


@pytest.mark.parametrize("count", [1, 3])
def test_each_frame_meets_its_background(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    """A frame may be changed before the next one is requested."""
    met: list[tuple[int, int]] = []

    def meet(
        frames: Iterable[Image | None], parameters: ExtractionParameters, backgrounds: Iterable[Image | None]
    ) -> NDArray[Any]:
        del parameters
        for frame, background in zip(frames, backgrounds, strict=True):
            assert frame is not None
            assert background is not None
            met.append((int(frame[0, 0, 0]), int(background[0, 0, 0])))
        return np.zeros(0)

    monkeypatch.setattr(extract, "extract_film", meet)
    grey = [np.full((480, 640, 3), level, np.uint8) for level in (100, 110, 120, 10, 20, 30)]
    write_background(tmp_path / "on", grey[:3])
    write_background(tmp_path / "off", grey[3 : 3 + count])
    manifests = {}
    for name in ("on", "off"):
        manifests[name] = ingest_film(tmp_path / name, tmp_path / "frames.zarr" / name).model_dump_json().encode()
    inputs = {"manifest": manifests["on"], "background": manifests["off"]}
    places = {"array": tmp_path / "frames.zarr/on", "background": tmp_path / "frames.zarr/off"}
    extract.run(inputs, ExtractionParameters(), places)
    assert met == ([(100, 10), (110, 20), (120, 30)] if count == 3 else [(100, 10), (110, 10), (120, 10)])


def test_torn_background_frame_costs_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    met: list[bool] = []

    def meet(frames: Iterable[Any], parameters: object, backgrounds: Iterable[Any]) -> NDArray[Any]:
        del parameters
        met.extend(background is not None for _, background in zip(frames, backgrounds, strict=True))
        return np.zeros(0)

    monkeypatch.setattr(extract, "extract_film", meet)
    write_background(tmp_path / "off", [surroundings(40)] * 3)
    torn = tmp_path / "off/001.jpg"
    torn.write_bytes(torn.read_bytes()[:2000])
    write_film(tmp_path / "on.avi", [jpeg(surroundings(40))] * 3, 640, 480, 18)
    stripe(tmp_path / "on.avi", tmp_path / "off", tmp_path)
    assert met == [True, False, True]


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def spoil(path: Path, how: str) -> None:
    image = surroundings(40)
    if how == "missing":
        return
    if how == "text":
        path.write_text("the lamp was off\n")
    elif how == "empty folder":
        path.mkdir()
    elif how == "another size":
        write_film(path, [jpeg(image[:240, :320])], 320, 240, 18)
    elif how == "another number":
        write_background(path, [image] * 3)
    else:
        write_background(path, [image] * (1 if path.suffix == ".png" else FRAMES))
        truncate(path)


REFUSED = [
    ("off.avi", "missing", "no such film"),
    ("off.avi", "text", "header: expected an AVI film"),
    ("off.avi", "truncated", "length: truncated: 100 of "),
    ("off.avi", "another size", "frame size: expected frames of 640 x 480 pixels, found 320 x 240"),
    ("off.avi", "another number", "frames: expected one frame or 20, as many as the film has, found 3"),
    ("off", "another number", "frames: expected one frame or 20, as many as the film has, found 3"),
    ("off", "empty folder", "no PNG or JPEG images in this folder"),
    ("off.png", "text", "expected a JPEG or PNG image (neither JPEG nor PNG)"),
    ("off.png", "truncated", "frames: expected a whole frame, found one that is torn"),
]


@pytest.mark.parametrize(("name", "how", "expected"), REFUSED, ids=[f"{name} {how}" for name, how, _ in REFUSED])
def test_refused_background_is_one_line(done: Any, name: str, how: str, expected: str) -> None:
    path = name_background(done, name)
    spoil(path, how)
    for again in (False, True):
        [end], ran = done.run()
        problem, _, _ = str(end.problem).partition(" (/")
        assert problem.startswith(f"{path}: {expected}")
        assert problem.isprintable()
        assert (end.kind, end.folder) == ("refused", None)
        assert ran == (set() if again or how in {"missing", "empty folder"} else {"background-5"})
    assert not (done.scan / "frames.zarr/cam5-background").exists()
    camera_1, camera_5 = ingest_scans([done.scan])
    assert camera_1.problem is None
    assert camera_5.problem is not None
    assert camera_5.problem.startswith(f"{path}: {expected}")


def test_background_is_a_path_as_others_are(archive: Any) -> None:
    document = archive.scan / "scan.yaml"
    text = document.read_text()
    name_background(archive, "../../../off.avi")
    with pytest.raises(RefusedInput, match=r"background of camera 5: '../../../off.avi' leaves the archive"):
        read_scan(archive.scan)
    document.write_text(text)
    name_background(archive, "/off.avi")
    with pytest.raises(RefusedInput, match=r"cameras.1.background: expected a path relative to this file"):
        read_scan(archive.scan)
    document.write_text(text)
    name_background(archive, "../off/")
    scan = read_scan(archive.scan)
    assert [scan.background(camera) for camera in scan.document.cameras] == [None, archive.scan.parent / "off"]


def test_background_is_ingested_by_hand_as_well(archive: Any) -> None:
    background = name_background(archive, "off.avi")
    write_background(background, [surroundings(40)] * FRAMES)
    _, camera_5 = ingest_scans([archive.scan])
    assert (camera_5.frames, camera_5.lost, camera_5.problem) == (FRAMES, 0, None)
    assert camera_5.film_bytes == (archive.scan / "cam5.avi").stat().st_size + background.stat().st_size
    arrays = [archive.scan / "frames.zarr" / name for name in ("cam5", "cam5-background")]
    assert camera_5.store_bytes == sum(path.stat().st_size for array in arrays for path in array.iterdir())
    attributes = json.loads((arrays[1] / "zarr.json").read_bytes())["attributes"]
    assert len(FrameManifest.model_validate(attributes["footscan"]).frames) == FRAMES


def test_only_the_steps_of_its_camera_know_of_a_background(
    archive: Any, calibration: Callable[..., Calibration]
) -> None:
    write_background(name_background(archive, "off.png"), [surroundings(40)])
    calibrated = CalibrationFile(archive.root / "calibration.json", calibration(), "0" * 64)
    digests = FileDigests(archive.root / "files.json")
    steps = scan_steps(read_scan(archive.scan), calibrated, ScanParameters(), digests)
    known = {step.name.rpartition("/")[2]: step for step in steps}
    assert (set(known["extract-1"].inputs), set(known["extract-1"].places)) == ({"manifest"}, {"array"})
    camera_5 = known["extract-5"]
    assert (set(camera_5.inputs), set(camera_5.places)) == ({"manifest", "background"}, {"array", "background"})
    assert [name for name in known if name.startswith("background")] == ["background-5"]


@pytest.fixture
def unfinished(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    """No extraction comes to its end."""

    def fail(*_: object) -> bytes:
        raise Fault("no power")

    with monkeypatch.context() as patch:
        patch.setattr(extract, "run", fail)
        yield patch


def test_plan_says_why_a_camera_is_extracted_again(done: Any, unfinished: pytest.MonkeyPatch) -> None:
    document = done.scan / "scan.yaml"
    text = document.read_text()
    background = name_background(done, "off.png")
    write_background(background, [surroundings(40)])
    steps, reasons = done.plan()
    assert steps == 24  # with its colours, and those of the surface
    assert reasons["background-5"] == "never run"
    assert reasons["extract-5"] == "waits for background of camera 5"
    assert not reasons.keys() & {"ingest-1", "extract-1", "map-1", "ingest-5"}
    done.run()
    steps, reasons = done.plan()
    assert reasons["extract-5"] == "input background changed"
    unfinished.undo()
    [end], ran = done.run()
    assert (end.problem, "extract-5" in ran, done.plan()) == (None, True, (24, {}))

    write_background(background, [surroundings(60)])
    _, reasons = done.plan()
    assert reasons["background-5"] == "input background changed"
    assert reasons["extract-5"] == "waits for background of camera 5"
    _, ran = done.run()
    assert {"background-5", "extract-5"} <= ran
    assert not ran & {"ingest-5", "ingest-1", "extract-1", "map-1"}

    document.write_text(text)
    assert done.plan() == (21, {})  # the scan without a background is what it was


def test_a_background_of_the_same_content_is_not_read_again(done: Any) -> None:
    background = name_background(done, "off.avi")
    write_background(background, [surroundings(40)] * FRAMES)
    done.run()
    shutil.copy(background, done.scan / "else.avi")
    document = done.scan / "scan.yaml"
    document.write_text(document.read_text().replace("off.avi", "else.avi"))
    assert done.plan() == (24, {})


def test_damaged_background_is_ingested_anew_within_the_run(done: Any) -> None:
    write_background(name_background(done, "off.avi"), [surroundings(40)] * FRAMES)
    done.run()
    array = done.scan / "frames.zarr/cam5-background"
    whole = frame_bytes(array, 6)
    put_frame(array, 6, whole[:-9])
    done.set_parameters("{extraction: {red_threshold: 20}}")
    [end], ran = done.run()
    assert end.problem is None
    assert "background-5" in ran
    assert not ran & {"ingest-1", "ingest-5"}
    assert frame_bytes(array, 6) == whole


def test_skin_is_coloured_where_laser_off_frames_show_it(done: Any) -> None:
    background = name_background(done, "off.avi")
    rose = np.full((480, 640, 3), (60, 36, 30), np.uint8)
    write_background(background, [rose] * FRAMES)
    done.run()
    foot = read_file(done.results / "foot.ply")
    assert foot.colours is not None
    assert foot.filled is not None
    red, green, blue = foot.colours[~foot.filled].mean(axis=0)
    assert red > green > blue
    assert (foot.metadata["patient"], foot.metadata["scan"], foot.metadata["side"]) == ("P0001", "S1", "right")


def test_without_laser_off_frames_there_is_no_colour(done: Any) -> None:
    foot = read_file(done.results / "foot.ply")
    assert foot.colours is None
    assert set(np.unique(foot.camera)) == {0, 1, 5}
