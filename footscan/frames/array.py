"""A camera's Zarr array of frames: which file a frame is, what the array holds, and its frames, each checked."""

import json
import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from footscan.frames.image import Rgb, frame_digest
from footscan.frames.shard import SHARD, ShardReader
from schemas.base.errors import DamagedError, Fault, RefusedInput
from schemas.base.image_size import ImageSize
from schemas.base.limits import BeyondLimitError, read_bounded, refuse_beyond
from schemas.frames import Encoding, FrameManifest

if TYPE_CHECKING:
    from numcodecs import Blosc

METADATA = "zarr.json"
BLOSC_HEADER = 16
_BROKEN = (ValueError, KeyError, TypeError, RecursionError)


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
        wanted = list(range(self.count) if numbers is None else numbers)
        present = [number for number in wanted if self.manifest.frames[number] is not None]
        chunks = iter(chunks_of(self.path, self.count, present))
        for number in wanted:
            digest = self.manifest.frames[number]
            chunk = None if digest is None else next(chunks)
            frame = chunk if chunk is None or self.encoding == "image" else unpacked(chunk, self.size)
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
    """File of one frame in its array while it is filmed, and in arrays of earlier versions, which have no shards."""
    return f"{frame}.0.0.0"


is_chunk_name = re.compile(r"\d+\.0\.0\.0").fullmatch
"""Whether a file's name is one that `chunk_name` gives."""


def chunks_of(array: Path, frames: int, numbers: Iterable[int]) -> Iterable[bytes | None]:
    """The chunks of these frames of an array of so many, None for each that cannot be read.

    Those of encoded images are the images: Zarr's own way takes as long as the decoding.
    """
    if is_sharded(array):
        return ShardReader(array, frames).chunks(numbers)
    return (_file_bytes(array / chunk_name(number)) for number in numbers)


def is_sharded(array: Path) -> bool:
    """Whether all frames of an array lie in one file."""
    return (array / SHARD).is_file()


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


def _attributes(array: Path) -> dict[str, Any]:
    attributes: dict[str, Any] = json.loads(read_bounded(array / METADATA, "json_bytes"))["attributes"]
    return attributes


def _file_bytes(chunk: Path) -> bytes | None:
    try:
        return read_bounded(chunk, "image_bytes")
    except BeyondLimitError:
        raise
    except (OSError, RefusedInput):
        return None


def packed(pixels: Rgb) -> bytes:
    """The chunk of a raw frame: what Zarr's Blosc codec makes of it."""
    chunk: bytes = _packer().encode(np.ascontiguousarray(pixels))
    return chunk


def unpacked(chunk: bytes, size: ImageSize) -> Rgb | None:
    """The raw frame in a chunk; None where it is none: one that was forged could unpack to anything.

    Blosc's header has the bytes before compression at its fifth byte.
    """
    shape = (*size, 3)
    if len(chunk) < BLOSC_HEADER or int.from_bytes(chunk[4:8], "little") != math.prod(shape):
        return None
    try:
        return np.frombuffer(_packer().decode(chunk), np.uint8).reshape(shape)
    except (RuntimeError, ValueError):
        return None


@cache
def _packer() -> "Blosc":
    from numcodecs import Blosc  # slow to import, and needed for raw frames alone

    return Blosc(cname="zstd", clevel=5, shuffle=Blosc.BITSHUFFLE, typesize=1)
