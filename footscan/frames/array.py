"""A camera's Zarr array of frames: which file a frame is, what the array holds, and its frames, each checked."""

import json
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from footscan.frames.image import Rgb, frame_digest
from schemas.base.errors import DamagedError, Fault, RefusedInput
from schemas.base.image_size import ImageSize
from schemas.base.limits import BeyondLimitError, read_bounded, refuse_beyond
from schemas.frames import Encoding, FrameManifest

METADATA = "zarr.json"


@dataclass(frozen=True)
class StoredFrames:
    """A `FrameReader` of an array, which checks each frame against the digest under which it was stored.

    DamagedError from `stored` where a frame is not the one that was ingested; Fault where it is not the one that was
    recorded, and there is no film to ingest it from.
    """

    path: Path
    manifest: FrameManifest

    @property
    def size(self) -> ImageSize:
        return self.manifest.size

    @property
    def count(self) -> int:
        return len(self.manifest.frames)

    @property
    def encoding(self) -> Encoding:
        return self.manifest.encoding

    def stored(self, numbers: Iterable[int] | None = None) -> Iterator[bytes | Rgb | None]:
        read = partial(_stored_bytes, self.path) if self.encoding == "image" else _pixel_reader(self.path, self.size)
        for number in range(self.count) if numbers is None else numbers:
            digest = self.manifest.frames[number]
            frame = None if digest is None else read(number)
            if digest is not None and (frame is None or frame_digest(frame) != digest):
                problem = f"{self.path}: frame {number} is damaged, expected the frame that was"
                if is_recorded(self.path):
                    raise Fault(f"{problem} recorded: restore it from a copy")
                raise DamagedError(f"{problem} ingested")
            yield frame


@dataclass(frozen=True)
class IngestedFrames(StoredFrames):
    """Frames that an earlier step has ingested: a damaged array is discarded, so that the next run ingests it anew."""

    def stored(self, numbers: Iterable[int] | None = None) -> Iterator[bytes | Rgb | None]:
        try:
            yield from super().stored(numbers)
        except DamagedError:
            discard(self.path)
            raise


def chunk_name(frame: int) -> str:
    """File of one frame within its array."""
    return f"{frame}.0.0.0"


def is_complete(array: Path) -> bool:
    """Whether a whole array is there; what it holds is checked frame by frame on reading."""
    try:
        return (array / METADATA).is_file()
    except OSError:  # no name that a file could have
        return False


def read_manifest(array: Path) -> FrameManifest:
    """What a complete array of ours holds; RefusedInput where it is another's, or its metadata are damaged."""
    try:
        manifest = FrameManifest.model_validate(_attributes(array)["footscan"])
    except OSError as error:
        raise RefusedInput(array, error.strerror or "cannot be read") from None
    except (*_BROKEN, ValidationError):
        raise RefusedInput(array, "expected an array of frames with its manifest", field=METADATA) from None
    refuse_beyond("image_pixels", math.prod(manifest.size), array)
    refuse_beyond("film_frames", len(manifest.frames), array)
    return manifest


def is_recorded(array: Path) -> bool:
    """Whether the frames were recorded straight into this array: there is no film that it could be made from anew."""
    try:
        return is_complete(array) and _attributes(array)["film"] is None
    except (OSError, *_BROKEN):
        return False


def discard(array: Path) -> None:
    """Take back the completeness of an array that was found damaged."""
    (array / METADATA).unlink(missing_ok=True)


_BROKEN = (ValueError, KeyError, TypeError, RecursionError)


def _attributes(array: Path) -> dict[str, Any]:
    attributes: dict[str, Any] = json.loads(read_bounded(array / METADATA, "json_bytes"))["attributes"]
    return attributes


def _stored_bytes(array: Path, frame: int) -> bytes | None:
    """A frame's file itself; None where it cannot be read.

    What is in it is the image, and Zarr's own way takes as long as the decoding.
    """
    try:
        return read_bounded(array / chunk_name(frame), "image_bytes")
    except BeyondLimitError:
        raise
    except (OSError, RefusedInput):
        return None


def _pixel_reader(array: Path, size: ImageSize) -> Callable[[int], Rgb | None]:
    import zarr  # 0.3 s that other commands need not wait for

    shape = (*size, 3)
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
