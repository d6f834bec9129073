"""Ingest: the camera's bytes bit for bit, and nothing that looks whole before it is."""

import errno
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simplejpeg
import zarr

from footscan.frames.array import StoredFrames, discard, is_complete
from footscan.frames.avi import AviFilm
from footscan.frames.ingest import ingest_film
from footscan.frames.reader import pixel_frames
from footscan.frames.shard import SHARD
from schemas.base.errors import Fault, RefusedInput
from schemas.base.image_size import ImageSize
from schemas.frames import GROUP, FrameManifest
from tests.helpers.stored_frames import frame_bytes, frames_of

SIZE = ImageSize(rows=48, columns=64)


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    folder = tmp_path / "scan"
    folder.mkdir()
    return folder


@pytest.fixture
def film(scan: Path, jpeg: Callable[..., bytes], write_mjpeg: Callable[..., Path]) -> Path:
    return write_mjpeg(scan / "cam1.avi", [jpeg(number) for number in (0, 1, 3)], [0, 1, 3])


@pytest.fixture
def array(scan: Path) -> Path:
    return scan / GROUP / "cam1"


def assert_holds(array: Path, manifest: FrameManifest, jpeg: Callable[..., bytes]) -> None:
    """The film above, whole, and no parts beside it."""
    for number, found in enumerate(pixel_frames(StoredFrames(array, manifest))):
        assert (found is None) == (number == 2)
        if found is not None:
            np.testing.assert_array_equal(found, simplejpeg.decode_jpeg(jpeg(number), "RGB"))
    assert list(array.parent.parent.glob(".*")) == []
    assert {path.name for path in array.parent.iterdir()} == {"zarr.json", "cam1"}


def test_bytes_of_the_camera_are_kept(film: Path, array: Path, jpeg: Callable[..., bytes]) -> None:
    manifest = ingest_film(film, array, SIZE)
    assert (manifest.encoding, manifest.size) == ("image", SIZE)
    assert [digest is None for digest in manifest.frames] == [False, False, True, False]
    assert frames_of(array) == [jpeg(0), jpeg(1), None, jpeg(3)]
    assert {path.name for path in array.iterdir()} == {"zarr.json", SHARD}
    assert (array / SHARD).read_bytes().startswith(jpeg(0) + jpeg(1) + jpeg(3))
    assert_holds(array, manifest, jpeg)


def test_plain_zarr_reads_the_frames(film: Path, array: Path, jpeg: Callable[..., bytes]) -> None:
    manifest = ingest_film(film, array, SIZE)
    group = zarr.open(str(array.parent), mode="r")
    for frames in (zarr.open(str(array), mode="r"), group["cam1"]):
        assert (frames.shape, frames.chunks, frames.dtype) == ((4, 48, 64, 3), (1, 48, 64, 3), np.uint8)
        assert frames.metadata.dimension_names == ("frame", "row", "column", "rgb")
        for number in (0, 1, 3):
            np.testing.assert_array_equal(frames[number], simplejpeg.decode_jpeg(jpeg(number), "RGB"))
        assert not frames[2].any()
        assert FrameManifest.model_validate(frames.attrs["footscan"]) == manifest


def test_another_process_reads_the_frames_without_importing_footscan(film: Path, array: Path) -> None:
    ingest_film(film, array, SIZE)
    code = f"import zarr; print(int(zarr.open({str(array)!r}, mode='r')[1].astype('int64').sum()))"
    shown = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=film.parent)
    assert int(shown.stdout) == int(np.asarray(zarr.open(str(array), mode="r")[1], np.int64).sum())


def test_store_is_hardly_larger_than_the_film(
    scan: Path, array: Path, jpeg: Callable[..., bytes], write_mjpeg: Callable[..., Path]
) -> None:
    pictures = [jpeg(number, 480, 640) for number in range(4)] * 10
    pictures = [picture[:22_000] for picture in pictures]  # the size of a dark frame with a stripe
    film = write_mjpeg(scan / "cam1.avi", pictures, rows=480, columns=640)
    ingest_film(film, array)
    store = sum(path.stat().st_size for path in array.parent.rglob("*") if path.is_file())
    assert sum(map(len, pictures)) < store < 1.05 * film.stat().st_size


def test_raw_film_is_kept_without_loss(
    scan: Path, array: Path, pixels: Callable[..., Any], write_raw: Callable[..., Path]
) -> None:
    smooth = [(pixels(number) // 32 * 32).astype(np.uint8) for number in range(4)]
    film = write_raw(scan / "cam1.avi", smooth)
    manifest = ingest_film(film, array, SIZE)
    assert manifest.encoding == "pixels"
    np.testing.assert_array_equal(np.asarray(zarr.open(str(array), mode="r")), smooth)
    for found, expected in zip(pixel_frames(StoredFrames(array, manifest)), smooth, strict=True):
        np.testing.assert_array_equal(found, expected)
    assert sum(path.stat().st_size for path in array.iterdir()) < film.stat().st_size


def test_folder_of_png_keeps_its_bytes(scan: Path, array: Path, pixels: Callable[..., Any]) -> None:
    from PIL import Image

    (scan / "cam1").mkdir()
    for number in range(3):
        Image.fromarray(pixels(number)).save(scan / f"cam1/{number}.png")
    manifest = ingest_film(scan / "cam1", array, SIZE)
    for number, found in enumerate(pixel_frames(StoredFrames(array, manifest))):
        np.testing.assert_array_equal(found, pixels(number))
        assert frame_bytes(array, number) == (scan / f"cam1/{number}.png").read_bytes()


def test_film_of_another_size_is_refused_and_nothing_is_left(film: Path, array: Path) -> None:
    with pytest.raises(RefusedInput, match=r"cam1\.avi: frame size: expected frames of at least 320 x 240 pixels"):
        ingest_film(film, array)
    assert list(film.parent.iterdir()) == [film]


@pytest.mark.parametrize(
    ("error", "raised"),
    [
        (KeyboardInterrupt(), KeyboardInterrupt),
        (RuntimeError("a defect"), RuntimeError),
        (OSError(errno.ENOSPC, "No space left on device"), Fault),
    ],
)
@pytest.mark.parametrize("again", [False, True])
def test_interrupted_ingest_leaves_what_was_there(
    film: Path,
    array: Path,
    jpeg: Callable[..., bytes],
    monkeypatch: pytest.MonkeyPatch,
    error: BaseException,
    raised: type[BaseException],
    again: bool,
) -> None:
    if again:
        ingest_film(film, array, SIZE)

    def torn(_: object) -> Iterator[bytes]:
        yield jpeg(7)
        yield jpeg(8)
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(AviFilm, "stored", torn)
        with pytest.raises(raised):
            ingest_film(film, array, SIZE)
    assert is_complete(array) == again
    assert array.exists() == again
    assert list(film.parent.glob(".*")) == []
    assert_holds(array, ingest_film(film, array, SIZE), jpeg)


def test_disk_that_refuses_is_a_fault(film: Path, array: Path) -> None:
    array.parent.write_text("in the way")
    with pytest.raises(Fault, match=r"cam1: cannot be written \((File exists|Not a directory)\)"):
        ingest_film(film, array, SIZE)


def test_killed_ingest_leaves_nothing_and_the_next_sweeps_up(
    scan: Path, array: Path, pixels: Callable[..., Any], write_raw: Callable[..., Path]
) -> None:
    film = write_raw(scan / "cam1.avi", [pixels(0, 480, 640)] * 90)
    code = (
        "from pathlib import Path; from footscan.frames.ingest import ingest_film;"
        f"ingest_film(Path({str(film)!r}), Path({str(array)!r}))"
    )
    process = subprocess.Popen([sys.executable, "-c", code])
    deadline = time.monotonic() + 60
    while not any(part.stat().st_size for part in scan.glob(".cam1.partial-*/*/*.partial")):
        assert process.poll() is None, "it was to be killed in the middle"
        assert time.monotonic() < deadline
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert not array.exists()
    assert not is_complete(array)
    assert len(list(scan.glob(".cam1.partial-*"))) == 1
    write_raw(scan / "cam1.avi", [pixels(0, 480, 640)] * 2)
    manifest = ingest_film(film, array)
    assert list(scan.glob(".*")) == []
    assert len(list(pixel_frames(StoredFrames(array, manifest)))) == 2


def test_parts_of_living_processes_and_of_other_machines_are_left(film: Path, array: Path) -> None:
    host = os.uname().nodename
    living = [
        film.parent / f".cam2.partial-{host}-1-{os.getppid()}",
        film.parent / ".cam2.partial-elsewhere-1-999999999",
    ]
    dead = film.parent / f".cam2.partial-{host}-1-999999999.old"
    for part in (*living, dead):
        part.mkdir()
    ingest_film(film, array, SIZE)
    assert all(part.exists() for part in living)
    assert not dead.exists()


def test_threads_may_ingest_one_array_at_once(film: Path, array: Path, jpeg: Callable[..., bytes]) -> None:
    together = threading.Barrier(4)

    def run(_: int) -> FrameManifest:
        together.wait()
        return ingest_film(film, array, SIZE)

    for _ in range(5):
        with ThreadPoolExecutor(4) as pool:
            manifests = list(pool.map(run, range(4)))
        assert all(manifest == manifests[0] for manifest in manifests)
        assert_holds(array, manifests[0], jpeg)


def test_cameras_may_be_ingested_at_once(film: Path, array: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda camera: ingest_film(film, array.with_name(f"cam{camera}"), SIZE), range(8)))
    assert sorted(zarr.open_group(str(array.parent), mode="r").array_keys()) == [f"cam{camera}" for camera in range(8)]


def test_processes_may_ingest_one_array_at_once(film: Path, array: Path, jpeg: Callable[..., bytes]) -> None:
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        ends = [pool.submit(ingest_film, film, array, SIZE) for _ in range(12)]
        manifests = [end.result() for end in ends]
    assert all(manifest == manifests[0] for manifest in manifests)
    assert_holds(array, manifests[0], jpeg)


def test_discarded_array_is_not_complete(film: Path, array: Path, jpeg: Callable[..., bytes]) -> None:
    ingest_film(film, array, SIZE)
    assert is_complete(array)
    discard(array)
    discard(array)
    assert not is_complete(array)
    assert_holds(array, ingest_film(film, array, SIZE), jpeg)
