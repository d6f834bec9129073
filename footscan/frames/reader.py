"""Frames out of their Zarr array, each checked against the digest under which it was stored."""

import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import zarr

from footscan.frames.array import METADATA, chunk_name, damage, stored_bytes
from footscan.frames.image import Rgb, decode_or_none, frame_digest, pixel_buffer
from schemas.base.errors import DamagedError
from schemas.base.limits import read_bounded
from schemas.frames import FrameManifest

_Reader = Callable[[int], bytes | Rgb | None]


def read_frames(array: Path, manifest: FrameManifest) -> Iterator[Rgb | None]:
    """The frames of a camera in order, (rows, columns, 3) uint8; None for a lost or torn one.

    Each array is valid until the next is asked for: all are decoded into one buffer.

    Raises
    ------
    DamagedError
        A frame is not the one that was ingested.
    Fault
        It is not the one that was recorded, and there is no film to ingest it from.
    """
    read = _chunk_reader(array, manifest)
    buffer = pixel_buffer(manifest.height, manifest.width)
    for number in range(len(manifest.frames)):
        yield _frame(array, manifest, number, read, buffer)


def read_frame(array: Path, manifest: FrameManifest, number: int) -> Rgb | None:
    """One frame of a camera, as `read_frames` gives it."""
    buffer = pixel_buffer(manifest.height, manifest.width)
    return _frame(array, manifest, number, _chunk_reader(array, manifest), buffer)


def _frame(array: Path, manifest: FrameManifest, number: int, read: _Reader, buffer: Rgb) -> Rgb | None:
    digest = manifest.frames[number]
    if digest is None:
        return None
    stored = read(number)
    if stored is None or frame_digest(stored) != digest:
        raise damage(array, number)
    return decode_or_none(stored, buffer) if isinstance(stored, bytes) else stored


def _chunk_reader(array: Path, manifest: FrameManifest) -> _Reader:
    return partial(stored_bytes, array) if manifest.encoding == "image" else _pixel_reader(array, manifest)


def _pixel_reader(array: Path, manifest: FrameManifest) -> _Reader:
    shape = (manifest.height, manifest.width, 3)
    try:
        read_bounded(array / METADATA, "json_bytes")  # before Zarr reads them
        frames = zarr.open_array(str(array), mode="r")
    except Exception as error:  # damaged metadata can make Zarr raise anything
        raise DamagedError(f"{array}: expected a Zarr array ({error})") from None
    if frames.shape[1:] != shape or frames.chunks != (1, *shape):
        raise DamagedError(f"{array}: expected frames of {shape}, found {frames.shape[1:]}")

    def read(number: int) -> Rgb | None:
        try:
            if not _is_chunk_of(array / chunk_name(number), math.prod(shape)):
                return None
            return np.asarray(frames[number], np.uint8)
        except Exception:  # a damaged chunk can make its decompressor raise anything
            return None

    return read


def _is_chunk_of(chunk: Path, size: int) -> bool:
    """Whether a chunk says that it holds so many bytes: one that was forged could unpack to anything.

    Blosc's header has the bytes before compression at its fifth byte; what does not compress is as long and a little
    longer.
    """
    if not chunk.is_file() or chunk.stat().st_size > size + 4096:
        return False
    with chunk.open("rb") as file:
        return int.from_bytes(file.read(8)[4:], "little") == size
