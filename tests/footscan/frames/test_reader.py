"""Frames by the one protocol of all their sources; out of an array the one that was ingested, or none at all."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import google_crc32c
import numpy as np
import pytest

from footscan.frames.array import IngestedFrames, StoredFrames, is_complete
from footscan.frames.film import open_film
from footscan.frames.image import encode_png
from footscan.frames.ingest import ingest_film
from footscan.frames.reader import FrameReader, backgrounds_of, pixel_frames
from footscan.frames.shard import SHARD
from schemas.base.errors import DamagedError
from schemas.base.image_size import ImageSize
from schemas.base.limits import BeyondLimitError
from schemas.frames import FrameManifest
from tests.helpers.stored_frames import frame_bytes, put_frame

SIZE = ImageSize(rows=48, columns=64)
Ingested = tuple[Path, FrameManifest]


@pytest.fixture
def ingested(encoding: str, tmp_path: Path, write_film: Callable[..., Path]) -> Ingested:
    array = tmp_path / "frames.zarr/cam1"
    manifest = ingest_film(write_film(tmp_path / "cam1.avi", encoding), array, SIZE)
    assert manifest.encoding == encoding
    return array, manifest


def flipped(frame: bytes, at: int) -> bytes:
    data = bytearray(frame)
    data[at] ^= 1
    return bytes(data)


def test_one_frame_is_as_all_give_it(ingested: Ingested) -> None:
    for number, frame in enumerate(pixel_frames(StoredFrames(*ingested))):
        assert frame is not None
        np.testing.assert_array_equal(next(pixel_frames(StoredFrames(*ingested), [number])), frame)


@pytest.mark.parametrize("damage", ["first byte", "middle byte", "cut", "emptied", "removed", "exchanged"])
def test_damaged_frame_is_noticed(ingested: Ingested, damage: str) -> None:
    array, manifest = ingested
    frame = frame_bytes(array, 2)
    match damage:
        case "first byte":
            put_frame(array, 2, flipped(frame, 0))
        case "middle byte":
            put_frame(array, 2, flipped(frame, len(frame) // 2))
        case "cut":
            put_frame(array, 2, frame[:-1])
        case "emptied":
            put_frame(array, 2, b"")
        case "removed":
            put_frame(array, 2, None)
        case "exchanged":
            put_frame(array, 2, frame_bytes(array, 3))
    frames = pixel_frames(StoredFrames(array, manifest))
    assert next(frames) is not None
    assert next(frames) is not None
    with pytest.raises(DamagedError, match=r"cam1: frame 2 is damaged, expected the frame that was ingested$"):
        next(frames)
    assert next(pixel_frames(StoredFrames(array, manifest), [3])) is not None


@pytest.mark.parametrize("metadata", [None, b"", b"{}", b'{"zarr_format": 3, "node_type": "group"}', b"\xff", b"[1]"])
def test_frames_are_read_without_the_metadata_of_zarr(ingested: Ingested, metadata: bytes | None) -> None:
    array, manifest = ingested
    (array / "zarr.json").unlink()
    if metadata is not None:
        (array / "zarr.json").write_bytes(metadata)
    assert len(list(pixel_frames(StoredFrames(array, manifest)))) == 4


@pytest.mark.parametrize("damage", ["cut", "index", "checksum", "emptied", "removed"])
def test_a_shard_without_its_index_is_damaged(ingested: Ingested, damage: str) -> None:
    array, manifest = ingested
    shard = array / SHARD
    content = shard.read_bytes()
    match damage:
        case "cut":
            shard.write_bytes(content[:-1])
        case "index":
            shard.write_bytes(content[:-20] + flipped(content[-20:], 3))
        case "checksum":
            shard.write_bytes(content[:-1] + flipped(content[-1:], 0))
        case "emptied":
            shard.write_bytes(b"")
        case "removed":
            shard.unlink()
    with pytest.raises(DamagedError, match="frame 0 is damaged"):
        list(pixel_frames(StoredFrames(array, manifest)))


def test_a_forged_index_reads_nothing_large(ingested: Ingested) -> None:
    array, manifest = ingested
    index = np.array([[0, 2**62]] * 4, "<u8").tobytes()
    content = (array / SHARD).read_bytes()[:-68] + index + google_crc32c.value(index).to_bytes(4, "little")
    (array / SHARD).write_bytes(content)
    with pytest.raises(BeyondLimitError, match="image_bytes"):
        list(pixel_frames(StoredFrames(array, manifest)))


def test_array_that_is_gone_is_noticed(ingested: Ingested) -> None:
    array, manifest = ingested
    shutil.rmtree(array)
    with pytest.raises(DamagedError):
        next(pixel_frames(StoredFrames(array, manifest), [0]))


def sources(folder: Path, pixels: Callable[..., Any], write_mjpeg: Any, write_raw: Any) -> Iterator[FrameReader]:
    """The same eight frames, without loss where the source can; the fifth is lost where a source can lose one."""
    pictures = [encode_png(pixels(number)) for number in range(8)]
    kept = [number for number in range(8) if number != 4]
    yield open_film(write_raw(folder / "raw.avi", [pixels(number) for number in range(8)]))
    (folder / "images").mkdir()
    for number, picture in enumerate(pictures):
        (folder / f"images/{number}.png").write_bytes(picture)
    yield open_film(folder / "images")
    film = write_mjpeg(folder / "cam1.avi", [pictures[number] for number in kept], kept)
    yield open_film(film)
    for name in ("cam1", "raw"):
        array = folder / f"frames.zarr/{name}"
        manifest = ingest_film(film.with_stem(name), array, SIZE)
        yield StoredFrames(array, manifest)
        yield IngestedFrames(array, manifest)


def test_every_source_gives_its_frames_alike(
    tmp_path: Path, pixels: Callable[..., Any], write_mjpeg: Callable[..., Path], write_raw: Callable[..., Path]
) -> None:
    readers = list(sources(tmp_path, pixels, write_mjpeg, write_raw))
    assert [reader.encoding for reader in readers] == ["pixels", *["image"] * 4, *["pixels"] * 2]
    for reader in readers:
        assert (reader.count, reader.size, reader.path.exists()) == (8, SIZE, True)
        for numbers in (None, [], [0], [6], [1, 4, 5], range(0, 8, 3)):
            asked = list(range(8) if numbers is None else numbers)
            for number, frame, stored in zip(asked, pixel_frames(reader, numbers), reader.stored(numbers), strict=True):
                assert stored is None or isinstance(stored, bytes) == (reader.encoding == "image")
                assert (frame is None) == (stored is None)
                if frame is None:
                    assert (number, reader.path.stem) == (4, "cam1")
                else:
                    np.testing.assert_array_equal(frame, pixels(number))


def test_a_damaged_array_is_discarded_where_a_step_has_ingested_it(ingested: Ingested) -> None:
    array, manifest = ingested
    put_frame(array, 2, flipped(frame_bytes(array, 2), 9))
    for reader, stays in ((StoredFrames(array, manifest), True), (IngestedFrames(array, manifest), False)):
        with pytest.raises(DamagedError):
            list(pixel_frames(reader))
        assert is_complete(array) == stays


def test_one_background_serves_every_frame(
    ingested: Ingested, tmp_path: Path, pixels: Callable[..., Any], write_raw: Callable[..., Path]
) -> None:
    reader = StoredFrames(*ingested)
    for found, expected in zip(backgrounds_of(reader, 4), pixel_frames(reader), strict=True):
        np.testing.assert_array_equal(found, expected)
    film = write_raw(tmp_path / "alone.avi", [pixels(7)])
    alone = StoredFrames(tmp_path / "alone", ingest_film(film, tmp_path / "alone", SIZE))
    served = list(backgrounds_of(alone, 3))
    assert len(served) == 3
    for found in served:
        np.testing.assert_array_equal(found, pixels(7))
