"""A film into a Zarr array `(frame, row, column, rgb)`, one frame a chunk, all chunks in one shard.

An array is written beside its place and renamed when it is whole: what has its name is complete.
"""

import os
import re
import shutil
import stat
from collections import Counter, deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import zarr
from zarr.codecs import BloscCodec
from zarr.errors import ContainsGroupError

from footscan.frames.array import (
    METADATA,
    chunk_name,
    is_chunk_name,
    is_recorded,
    packed,
    read_manifest,
)
from footscan.frames.codec import ImageCodec
from footscan.frames.film import open_background, open_camera_film, open_film
from footscan.frames.image import frame_digest
from footscan.frames.partial import make_partial, move_into_place, partial_folder, sweep
from footscan.frames.reader import FrameReader
from footscan.frames.shard import SHARD, ShardWriter
from schemas.base.errors import Fault, RefusedInput
from schemas.base.image_size import ImageSize
from schemas.base.limits import read_bounded
from schemas.frames import Encoding, FrameManifest


def ingest_film(film: Path, array: Path, size: ImageSize | None = None) -> FrameManifest:
    """Write the frames of `film` as the Zarr array `array`, in place of what is there.

    JPEG and PNG frames keep their bytes; raw ones are compressed without loss. Frames that were recorded straight into
    `array`, which then is the film, are only checked.

    Parameters
    ----------
    film : Path
        An AVI, a folder of images, or a recorded array.
    array : Path
        Folder of the array, e.g. `SCAN/frames.zarr/cam1`; its parent becomes a Zarr group.
    size : ImageSize, optional
        Expected size of the frames; without it, any size from 320 x 240 up.

    Raises
    ------
    RefusedInput
        The film is missing, truncated, or of another size; or `array` holds another camera's recorded frames.
    Fault
        The array cannot be written, and nothing that looks whole is left; or a recorded frame is damaged; or something
        lies at the array's place that footscan did not write.
    """
    opened = open_camera_film(film) if size is None else open_film(film, size)
    if film.resolve() == array.resolve():
        deque(opened.stored(), maxlen=0)  # each is checked on reading
        return read_manifest(array)
    if is_recorded(array):
        raise RefusedInput(array, "holds frames that were recorded into it, expected scan.yaml to name it as the film")
    if (array.parent / METADATA).exists():
        read_bounded(array.parent / METADATA, "json_bytes")  # before Zarr reads them, of any size
    _expect_own(array)
    partial = partial_folder(array.parent.parent, array.name)  # outside of the group: no reader of it meets a part
    try:
        array.parent.mkdir(parents=True, exist_ok=True)
        sweep(array.parent.parent)
        if partial.is_symlink():  # which `rmtree` leaves alone, and Zarr would write through
            partial.unlink()
        shutil.rmtree(partial, ignore_errors=True)
        make_partial(partial, array.parent)
        manifest = _write_frames(opened, partial / array.name)
        move_into_place(partial / array.name, array)
        make_group(array.parent)
    except OSError as error:
        raise Fault(f"{array}: cannot be written ({error.strerror or error})") from None
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return manifest


class FrameWriter:
    """Writes encoded frames into a folder, one a file as they come, of which `finish` makes a Zarr array.

    OSError where the disk refuses.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True)
        self._folder = folder
        self._digests: dict[int, str] = {}

    def add(self, number: int, data: bytes) -> None:
        """Frame `number`, a JPEG or PNG image, bit for bit."""
        (self._folder / chunk_name(number)).write_bytes(data)
        self._digests[number] = frame_digest(data)

    def renumber(self, numbers: Mapping[int, int]) -> None:
        """Frame k becomes what was frame `numbers[k]`, which may become several; all others are removed."""
        waiting = {old: self._folder / f"{old}.renumbered" for old in self._digests}
        for old, path in waiting.items():  # a new number may still be another frame's old one
            (self._folder / chunk_name(old)).rename(path)
        uses = Counter(numbers.values())
        for new, old in numbers.items():
            uses[old] -= 1
            place = self._folder / chunk_name(new)
            shutil.copyfile(waiting[old], place) if uses[old] else waiting[old].rename(place)
        for old in waiting.keys() - set(numbers.values()):
            waiting[old].unlink()
        self._digests = {new: self._digests[old] for new, old in numbers.items()}

    def finish(self, frames: int, size: ImageSize) -> FrameManifest:
        """Makes the folder an array of so many frames, which no film holds; those that were never added are lost."""
        digests = [self._digests.get(number) for number in range(frames)]
        with ShardWriter(self._folder, frames) as shard:
            for number in sorted(self._digests):
                shard.add(number, (self._folder / chunk_name(number)).read_bytes())
        for number in self._digests:
            (self._folder / chunk_name(number)).unlink()
        return _describe(create_array(self._folder, "image", frames, size), "image", digests, None)


def ingest_background(background: Path, array: Path, frames: int, size: ImageSize) -> FrameManifest:
    """`ingest_film` for the background of a film of so many `frames` of this `size`.

    Raises
    ------
    RefusedInput
        As in `ingest_film` and `open_background`.
    """
    open_background(background, size, frames)
    return ingest_film(background, array, size)


def make_group(folder: Path) -> None:
    """Makes the folder of several arrays a Zarr group."""
    try:
        zarr.open_group(str(folder), mode="a")
    except ContainsGroupError:  # another camera's thread was first
        return
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:  # what damaged metadata do to it
        raise RefusedInput(folder / METADATA, f"expected a Zarr group ({error})") from None


def _expect_own(array: Path) -> None:
    """Fault where something lies in an array's place that is none of ours: it would be removed with the array.

    No RefusedInput: that would be remembered of the film, which is not at fault.
    """
    expected = "expected nothing but an array of frames there; move it elsewhere"
    try:
        if not stat.S_ISDIR(array.lstat().st_mode):
            raise Fault(f"{array}: was not written by footscan, {expected}")
        with os.scandir(array) as entries:
            foreign = [one.name for one in entries if not _is_own_file(one)]
    except (FileNotFoundError, NotADirectoryError):  # perhaps only now: another thread replaces the array
        return
    if foreign:
        raise Fault(f"{array}: holds {min(foreign)}, which footscan did not write; {expected}")


_IS_OURS = re.compile(
    rf"({re.escape(METADATA)}|{re.escape(SHARD)})(\.partial)?|\d+\.renumbered|[\w.]+\.[0-9a-f]{{32}}\.partial"
).fullmatch
"""Names of a shard, of Zarr's document, and of what is left of them, or of frames, by a process that was killed."""


def _is_own_file(entry: "os.DirEntry[str]") -> bool:
    is_our_name = is_chunk_name(entry.name) or _IS_OURS(entry.name)
    return is_our_name is not None and not entry.is_dir(follow_symlinks=False)


def _write_frames(film: FrameReader, folder: Path) -> FrameManifest:
    array = create_array(folder, film.encoding, film.count, film.size)
    digests: list[str | None] = []
    with ShardWriter(folder, film.count) as shard:
        for number, frame in enumerate(film.stored()):
            digests.append(None if frame is None else frame_digest(frame))
            if frame is not None:
                shard.add(number, frame if isinstance(frame, bytes) else packed(frame))
    return _describe(array, film.encoding, digests, film.path.name)


def create_array(folder: Path, encoding: Encoding, frames: int, size: ImageSize) -> "zarr.Array[Any]":
    """A new Zarr array of so many frames, all lost: the shard is written by `ShardWriter`."""
    return zarr.create_array(
        store=str(folder),
        shape=(frames, *size, 3),
        chunks=(1, *size, 3),
        shards=(max(frames, 1), *size, 3),
        dtype="uint8",
        fill_value=0,
        # A background of one frame lies beside films of many, and xarray wants dimensions of one name to be as long.
        dimension_names=("single_frame" if frames == 1 else "frame", "row", "column", "rgb"),
        chunk_key_encoding={"name": "default", "separator": "."},  # `SHARD`, in the folder itself
        **(
            {"compressors": BloscCodec(cname="zstd", clevel=5, shuffle="bitshuffle", typesize=1)}
            if encoding == "pixels"
            else {"serializer": ImageCodec(), "compressors": None}
        ),
    )


def _describe(
    array: "zarr.Array[Any]", encoding: Encoding, digests: list[str | None], film: str | None
) -> FrameManifest:
    """Writes down what an array holds, and the `film` that it was ingested from."""
    manifest = FrameManifest(encoding=encoding, height=array.shape[1], width=array.shape[2], frames=digests)
    array.update_attributes({"footscan": manifest.model_dump(mode="json"), "film": film})
    return manifest
