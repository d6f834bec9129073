"""A recording: the camera's bytes, under their final numbers, in a scan that is whole or not there."""

import errno
import json
import os
import queue
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import namedtuple
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import simplejpeg
import zarr

from footscan.capture import recording as module
from footscan.capture.recording import LEAST_FREE_BYTES, ScanRecording
from footscan.frames.array import StoredFrames, is_recorded, read_manifest
from footscan.frames.ingest import FrameWriter, ingest_film
from footscan.frames.reader import pixel_frames
from footscan.frames.shard import SHARD
from schemas.base.errors import Fault, RefusedInput
from schemas.scan import Scan
from tests.helpers.stored_frames import frame_bytes, frames_of, put_frame

FILM = "frames.zarr/cam1"
DOCUMENT = Scan.model_validate(
    {
        "format": "footscan.scan/1",
        "patient": "P0001",
        "scan": "R1",
        "side": "right",
        "cameras": [{"id": 1, "file": FILM, "positions": "cam1.csv"}],
    }
)


def jpeg(number: int) -> bytes:
    return bytes(simplejpeg.encode_jpeg(np.full((480, 640, 3), number, np.uint8), 90, "RGB", "420"))


@pytest.fixture
def place(tmp_path: Path) -> Path:
    return tmp_path / "archive/P0001/R1"


def record(place: Path, frames: dict[int, int], count: int) -> Path:
    """A scan of one camera whose picture of arrival k is all grey of level k."""
    with ScanRecording(place, 1000) as recording:
        recording.open_film("cam1")
        for arrival in range(20):
            recording.take("cam1", arrival, jpeg(arrival))
        recording.settle()
        recording.close_film("cam1", frames, count)
        recording.file("cam1.csv").write_text("frame,x_mm\n" + "".join(f"{k},{k}\n" for k in range(count)))
        return recording.finish(DOCUMENT)


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_frames_have_their_numbers_and_their_bytes(place: Path) -> None:
    # The first two came before the travel, arrival 5 was torn, the camera lost an exposure behind arrival 8; in this
    # order new numbers are other frames' old ones.
    frames = {0: 2, 1: 3, 2: 4, 4: 6, 5: 7, 6: 8, 8: 10, 9: 10}
    assert record(place, frames, 10) == place
    array = place / FILM
    manifest = read_manifest(array)
    assert [number for number, digest in enumerate(manifest.frames) if digest is None] == [3, 7]
    for number, arrival in frames.items():
        assert frame_bytes(array, number) == jpeg(arrival)
    assert names(array) == {"zarr.json", SHARD}
    assert names(place) == {"scan.yaml", "cam1.csv", "frames.zarr"}
    assert names(place.parent) == {"R1"}
    assert is_recorded(array)


def test_one_picture_may_stand_for_several_frames(place: Path) -> None:
    record(place, {0: 1, 1: 1, 2: 0, 3: 1}, 4)
    assert frames_of(place / FILM) == [jpeg(k) for k in (1, 1, 0, 1)]


def test_plain_zarr_reads_a_recording(place: Path) -> None:
    record(place, {0: 4, 2: 7}, 3)
    frames = zarr.open_group(str(place / "frames.zarr"), mode="r")["cam1"]
    assert (frames.shape, frames.chunks) == ((3, 480, 640, 3), (1, 480, 640, 3))
    assert [int(frames[k].max()) for k in range(3)] == [4, 0, 7]


def test_a_recording_is_its_own_film(place: Path) -> None:
    record(place, {0: 4, 2: 7}, 3)
    array = place / FILM
    before = {path.name: path.stat().st_mtime_ns for path in array.iterdir()}
    manifest = ingest_film(array, array)
    assert manifest == read_manifest(array)
    assert before == {path.name: path.stat().st_mtime_ns for path in array.iterdir()}
    grey = [None if frame is None else int(frame.max()) for frame in pixel_frames(StoredFrames(array, manifest))]
    assert grey == [4, None, 7]


def test_a_recording_named_elsewhere_is_copied(place: Path, tmp_path: Path) -> None:
    record(place, {0: 4, 2: 7}, 3)
    copy = tmp_path / "other/frames.zarr/cam5"
    assert ingest_film(place / FILM, copy) == read_manifest(place / FILM)
    assert frame_bytes(copy, 2) == jpeg(7)
    assert not is_recorded(copy)


def test_another_film_never_overwrites_a_recording(place: Path, tmp_path: Path) -> None:
    record(place, {0: 4}, 1)
    other = record(tmp_path / "archive/P0001/R2", {0: 5}, 1)
    with pytest.raises(RefusedInput, match="cam1: holds frames that were recorded into it"):
        ingest_film(other / FILM, place / FILM)
    assert frame_bytes(place / FILM, 0) == jpeg(4)


@pytest.mark.parametrize("harm", ["flipped", "missing"])
def test_a_damaged_recording_is_refused_with_the_frame_and_stays(place: Path, harm: str) -> None:
    record(place, {0: 4, 1: 7}, 2)
    array = place / FILM
    manifest = read_manifest(array)
    put_frame(array, 1, None if harm == "missing" else jpeg(8))
    with pytest.raises(Fault, match="cam1: frame 1 is damaged, expected the frame that was recorded"):
        ingest_film(array, array)
    with pytest.raises(Fault, match="frame 1 is damaged, expected the frame that was recorded"):
        list(pixel_frames(StoredFrames(array, manifest)))
    put_frame(array, 1, jpeg(7))
    assert ingest_film(array, array) == manifest


def test_nothing_is_left_of_a_recording_that_is_given_up(place: Path) -> None:
    with ScanRecording(place, 1000) as recording:
        recording.open_film("cam1")
        recording.take("cam1", 0, jpeg(0))
        recording.settle()
        assert list(place.parent.glob(".R1.partial-*/frames.zarr/cam1/0.0.0.0"))
    assert not place.parent.parent.exists()


def test_a_folder_that_was_there_before_stays(place: Path) -> None:
    place.parent.mkdir(parents=True)
    with ScanRecording(place, 1000):
        pass
    assert place.parent.is_dir()


def test_an_open_film_cannot_be_finished_and_a_dropped_one_leaves_nothing(place: Path) -> None:
    with ScanRecording(place, 1000) as recording:
        recording.open_film("cam1")
        recording.open_film("cam2")
        recording.close_film("cam1", {}, 1)
        with pytest.raises(RefusedInput, match="expected all films to be closed, found cam2"):
            recording.finish(DOCUMENT)
        recording.drop_film("cam2")
        recording.finish(DOCUMENT)
    assert names(place / "frames.zarr") == {"zarr.json", "cam1"}


def test_a_scan_is_never_overwritten(place: Path) -> None:
    record(place, {0: 4}, 1)
    with pytest.raises(RefusedInput, match="R1: is there already"):
        ScanRecording(place, 1000)
    with ScanRecording(place.with_name("R2"), 1000) as recording:
        shutil.copytree(place, place.with_name("R2"))
        with pytest.raises(Fault, match="R2: cannot be written"):
            recording.finish(DOCUMENT)
    assert names(place.parent) == {"R1", "R2"}
    assert frame_bytes(place.with_name("R2") / FILM, 0) == jpeg(4)


def test_without_space_nothing_begins(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with_free(monkeypatch, LEAST_FREE_BYTES + 100_000_000)
    with pytest.raises(Fault, match=r"R1: 150 MB are free there, expected 180 MB: make room"):
        ScanRecording(place, 100_000_000)
    assert not place.parent.exists()
    ScanRecording(place, 70_000_000).close()


def test_a_disk_that_fills_up_is_told_once_and_leaves_nothing(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with ScanRecording(place, 1000) as recording:
        recording.open_film("cam1")
        recording.take("cam1", 0, jpeg(0))
        recording.settle()
        monkeypatch.setattr(FrameWriter, "add", full)
        recording.take("cam1", 1, jpeg(1))
        with pytest.raises(Fault, match=r"R1: cannot be written \(No space left on device\)$"):
            recording.settle()
        with pytest.raises(queue.Full):
            recording.take("cam1", 2, jpeg(2))
        with pytest.raises(Fault, match="No space left"):
            recording.finish(DOCUMENT)
    assert not place.parent.exists()


def test_a_disk_that_others_fill_ends_the_recording(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FRAMES_A_LOOK", 3)
    with ScanRecording(place, 1000) as recording:
        recording.open_film("cam1")
        with_free(monkeypatch, LEAST_FREE_BYTES - 1)
        for arrival in range(3):
            recording.take("cam1", arrival, jpeg(arrival))
        with pytest.raises(Fault, match="50 MB are free there, expected 50 MB: make room"):
            recording.settle()


def test_memory_is_bounded_where_the_disk_is_slow(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    free = threading.Event()
    with ScanRecording(place, 1000) as recording:
        recording.open_film("cam1")
        monkeypatch.setattr(FrameWriter, "add", lambda *_: free.wait(60))
        for arrival in range(module.WAITING_FRAMES):
            recording.take("cam1", arrival, b"")
        wait_for(lambda: recording._waiting.qsize() < module.WAITING_FRAMES)
        recording.take("cam1", module.WAITING_FRAMES, b"")  # the first one is being written
        with pytest.raises(queue.Full):
            recording.take("cam1", module.WAITING_FRAMES + 1, b"")
        free.set()


def test_a_killed_recording_leaves_nothing_to_see_and_the_next_sweeps_up(place: Path) -> None:
    code = (
        "import time; from pathlib import Path; from footscan.capture.recording import ScanRecording\n"
        f"recording = ScanRecording(Path({str(place)!r}), 1000)\n"
        "recording.open_film('cam1')\n"
        "for arrival in range(100000): recording.take('cam1', arrival, b'frame'); time.sleep(0.01)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code])
    wait_for(lambda: list(place.parent.glob(".R1.partial-*/frames.zarr/cam1/3.0.0.0")), process)
    living = next(place.parent.glob(".R1.partial-*"))
    with ScanRecording(place.with_name("R2"), 1000):
        assert living.exists(), "its process is alive"
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert not place.exists()
    assert not list(place.parent.parent.rglob("scan.yaml"))
    with ScanRecording(place.parent.with_name("P0002") / "L1", 1000):  # another patient's is as good
        assert not living.exists()


def test_a_scan_is_on_the_disk_before_it_has_its_name(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[str] = []
    fsync = os.fsync

    def noted(descriptor: int) -> None:
        path = str(Path(f"/proc/self/fd/{descriptor}").readlink())
        synced.append(path.partition("/P0001/")[2] or path)
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", noted)
    record(place, {0: 4}, 1)
    hidden = [path for path in synced if path.startswith(".R1.partial")]
    assert {Path(path).name for path in hidden} >= {SHARD, "zarr.json", "cam1", "frames.zarr", "cam1.csv"}
    assert Path(hidden[-1]).name == "scan.yaml"
    assert synced[len(hidden)] == "R1"
    assert synced[-1].endswith("/P0001")


def test_the_array_says_that_no_film_is_behind_it(place: Path) -> None:
    record(place, {0: 4}, 1)
    attributes = json.loads((place / FILM / "zarr.json").read_bytes())["attributes"]
    assert attributes["film"] is None


@pytest.fixture(autouse=True)
def _no_thread_stays() -> Iterator[None]:
    yield
    assert not [thread for thread in threading.enumerate() if thread.name == "recording"]


def with_free(monkeypatch: pytest.MonkeyPatch, free: int) -> None:
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(10**12, 0, free))


def wait_for(happened: Callable[[], object], process: subprocess.Popen[bytes] | None = None) -> None:
    deadline = time.monotonic() + 60
    while not happened():
        assert process is None or process.poll() is None, "it was to be killed in the middle"
        assert time.monotonic() < deadline
        time.sleep(0.01)
