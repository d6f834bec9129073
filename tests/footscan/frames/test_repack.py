"""Arrays of one file a frame become arrays of one shard: the same bytes, and whole at every moment."""

import json
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

from footscan.frames.array import StoredFrames, chunk_name, chunks_of, read_manifest
from footscan.frames.ingest import ingest_film
from footscan.frames.reader import pixel_frames
from footscan.frames.repack import repack
from footscan.frames.shard import SHARD
from schemas.base.errors import DamagedError, Fault
from schemas.base.image_size import ImageSize
from tests.helpers.stored_frames import frames_of

SIZE = ImageSize(rows=48, columns=64)


@pytest.fixture
def old(encoding: str, tmp_path: Path, write_film: Callable[..., Path]) -> Path:
    """An array of four frames as earlier versions wrote it; the third of images is lost."""
    array = tmp_path / "frames.zarr/cam1"
    ingest_film(write_film(tmp_path / "cam1.avi", encoding, lost=[2]), array, SIZE)
    for number, chunk in enumerate(list(chunks_of(array, 4, range(4)))):
        if chunk is not None:
            (array / chunk_name(number)).write_bytes(chunk)
    (array / SHARD).unlink()
    document = json.loads((array / "zarr.json").read_bytes())
    document["chunk_grid"]["configuration"]["chunk_shape"] = [1, *SIZE, 3]
    document["codecs"] = document["codecs"][0]["configuration"]["codecs"]
    document["chunk_key_encoding"] = {"name": "v2", "configuration": {"separator": "."}}
    (array / "zarr.json").write_text(json.dumps(document))
    return array


def shown(array: Path) -> list[Any]:
    """All frames as Zarr reads them."""
    return list(np.asarray(zarr.open_array(str(array), mode="r")))


def test_old_arrays_are_read(old: Path) -> None:
    for frame, expected in zip(pixel_frames(StoredFrames(old, read_manifest(old))), shown(old), strict=True):
        np.testing.assert_array_equal(np.zeros_like(expected) if frame is None else frame, expected)


def test_bytes_and_manifest_stay_and_files_become_two(old: Path) -> None:
    frames, manifest, before = frames_of(old), read_manifest(old), shown(old)
    count = len(list(old.iterdir()))
    assert repack(old) == count - 2
    assert sorted(file.name for file in old.iterdir()) == [SHARD, "zarr.json"]
    assert (frames_of(old), read_manifest(old)) == (frames, manifest)
    np.testing.assert_array_equal(shown(old), before)
    written = (old / SHARD).stat().st_mtime_ns
    assert repack(old) == 0
    assert (old / SHARD).stat().st_mtime_ns == written


@pytest.mark.parametrize("moment", range(1, 6))
def test_interrupted_anywhere_the_array_is_whole_and_the_next_call_goes_on(
    old: Path, monkeypatch: pytest.MonkeyPatch, moment: int
) -> None:
    """The process ends before the n-th change of the folder."""
    frames, before, changes = frames_of(old), shown(old), 0

    def ending(change: Callable[..., Any]) -> Callable[..., Any]:
        def instead(self: Path, *arguments: Any, **options: Any) -> Any:
            nonlocal changes
            if self.parent == old:
                changes += 1
                if changes >= moment:
                    raise KeyboardInterrupt
            return change(self, *arguments, **options)

        return instead

    with monkeypatch.context() as patch, suppress(KeyboardInterrupt):
        for name in ("replace", "unlink"):
            patch.setattr(Path, name, ending(getattr(Path, name)))
        repack(old)
    assert changes == moment
    np.testing.assert_array_equal(shown(old), before)
    repack(old)
    assert frames_of(old) == frames
    np.testing.assert_array_equal(shown(old), before)
    assert {file.name for file in old.iterdir()} == {SHARD, "zarr.json"}


def test_a_damaged_frame_stops_it_and_the_array_stays(old: Path) -> None:
    files = {file.name: file.read_bytes() for file in old.iterdir()}
    (old / chunk_name(1)).write_bytes(b"torn")
    with pytest.raises(DamagedError, match="frame 1 is damaged"):
        repack(old)
    (old / chunk_name(1)).write_bytes(files[chunk_name(1)])
    assert {file.name: file.read_bytes() for file in old.iterdir()} == files


def test_a_full_disk_is_a_fault_and_the_array_stays(old: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = shown(old)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(Fault, match="cam1: cannot be written"):
        repack(old)
    np.testing.assert_array_equal(shown(old), before)
    assert SHARD not in {file.name for file in old.iterdir()}


def test_nothing_is_done_without_an_array(tmp_path: Path) -> None:
    assert repack(tmp_path / "missing") == 0
