"""Frames out of their array: the one that was ingested, or none at all."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from footscan.frames.array import StoredFrames, chunk_name
from footscan.frames.ingest import ingest_film
from footscan.frames.reader import pixel_frames
from schemas.base.errors import DamagedError
from schemas.base.image_size import ImageSize
from schemas.frames import FrameManifest

SIZE = ImageSize(rows=48, columns=64)
Ingested = tuple[Path, FrameManifest]


@pytest.fixture(params=["image", "pixels"])
def ingested(
    request: pytest.FixtureRequest,
    tmp_path: Path,
    pixels: Callable[..., Any],
    jpeg: Callable[..., bytes],
    write_mjpeg: Callable[..., Path],
    write_raw: Callable[..., Path],
) -> Ingested:
    path = tmp_path / "cam1.avi"
    if request.param == "image":
        write_mjpeg(path, [jpeg(number) for number in range(4)])
    else:
        write_raw(path, [pixels(number) for number in range(4)])
    array = tmp_path / "frames.zarr/cam1"
    manifest = ingest_film(path, array, SIZE)
    assert manifest.encoding == request.param
    return array, manifest


def flip(path: Path, at: int) -> None:
    data = bytearray(path.read_bytes())
    data[at] ^= 1
    path.write_bytes(data)


def test_one_frame_is_as_all_give_it(ingested: Ingested) -> None:
    for number, frame in enumerate(pixel_frames(StoredFrames(*ingested))):
        assert frame is not None
        np.testing.assert_array_equal(next(pixel_frames(StoredFrames(*ingested), [number])), frame)


@pytest.mark.parametrize("damage", ["first byte", "middle byte", "cut", "emptied", "removed", "exchanged"])
def test_damaged_frame_is_noticed(ingested: Ingested, damage: str) -> None:
    array, manifest = ingested
    chunk = array / chunk_name(2)
    match damage:
        case "first byte":
            flip(chunk, 0)
        case "middle byte":
            flip(chunk, chunk.stat().st_size // 2)
        case "cut":
            chunk.write_bytes(chunk.read_bytes()[:-1])
        case "emptied":
            chunk.write_bytes(b"")
        case "removed":
            chunk.unlink()
        case "exchanged":
            shutil.copy(array / chunk_name(3), chunk)
    frames = pixel_frames(StoredFrames(array, manifest))
    assert next(frames) is not None
    assert next(frames) is not None
    with pytest.raises(DamagedError, match=r"cam1: frame 2 is damaged, expected the frame that was ingested$"):
        next(frames)
    assert next(pixel_frames(StoredFrames(array, manifest), [3])) is not None


@pytest.mark.parametrize("metadata", [None, b"", b"{}", b'{"zarr_format": 3, "node_type": "group"}', b"\xff", b"[1]"])
def test_damaged_metadata_are_noticed_where_they_are_needed(ingested: Ingested, metadata: bytes | None) -> None:
    array, manifest = ingested
    (array / "zarr.json").unlink()
    if metadata is not None:
        (array / "zarr.json").write_bytes(metadata)
    if manifest.encoding == "image":
        assert len(list(pixel_frames(StoredFrames(array, manifest)))) == 4
    else:
        with pytest.raises(DamagedError, match=r"cam1: expected a Zarr array"):
            list(pixel_frames(StoredFrames(array, manifest)))


def test_array_that_is_gone_is_noticed(ingested: Ingested) -> None:
    array, manifest = ingested
    shutil.rmtree(array)
    with pytest.raises(DamagedError):
        next(pixel_frames(StoredFrames(array, manifest), [0]))
