"""Frames out of their Zarr array, each checked against the digest under which it was stored."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import zarr

from footscan.frames.array import damage, stored_bytes
from footscan.frames.film import decode_or_none, frame_digest
from footscan.frames.image import Rgb, pixel_buffer
from schemas.errors import DamagedError
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
    return partial(stored_bytes, array) if manifest.encoding == "image" else _pixel_reader(array)


def _pixel_reader(array: Path) -> _Reader:
    try:
        frames = zarr.open_array(str(array), mode="r")
    except Exception as error:  # damaged metadata can make Zarr raise anything
        raise DamagedError(f"{array}: expected a Zarr array ({error})") from None

    def read(number: int) -> Rgb | None:
        try:
            return np.asarray(frames[number], np.uint8)
        except Exception:  # a damaged chunk can make its decompressor raise anything
            return None

    return read
