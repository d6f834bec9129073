"""The frames of a camera in one file: a shard of Zarr's `sharding_indexed` codec with its index at the end.

The frames lie one after the other, each as it would be in a file of its own. The index has offset and length of each,
as little-endian uint64, and a CRC32C: https://zarr-specs.readthedocs.io/en/latest/v3/codecs/sharding-indexed.
"""

import os
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

import google_crc32c
import numpy as np
from numpy.typing import NDArray

from schemas.base.limits import refuse_beyond

SHARD = "c.0.0.0.0"
"""File of the shard within its array; frames of arrays without shards have files of other names."""
MISSING = np.uint64(2**64 - 1)
"""Offset and length of a frame that was lost."""
CHECKSUM_BYTES = 4


class ShardWriter:
    """Writes frames one after the other; the shard is whole once it was left without an error, and synced to the disk.

    OSError where the disk refuses.
    """

    def __init__(self, array: Path, frames: int) -> None:
        self._place = array / SHARD
        self._partial = array / f"{SHARD}.partial"
        self._index = np.full((frames, 2), MISSING, "<u8")
        self._end = 0
        self._file: BinaryIO = self._partial.open("wb")

    def add(self, number: int, data: bytes) -> None:
        """Frame `number`, in any order."""
        self._file.write(data)
        self._index[number] = self._end, len(data)
        self._end += len(data)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._file:
            if error is None:
                index = self._index.tobytes()
                self._file.write(index + google_crc32c.value(index).to_bytes(CHECKSUM_BYTES, "little"))
                self._file.flush()
                os.fsync(self._file.fileno())
        if error is None:
            self._partial.replace(self._place)
        else:
            self._partial.unlink(missing_ok=True)


class ShardReader:
    """Reads the frames of a shard; a shard that is missing or damaged has none.

    array : folder of the array
    frames : number of its frames
    """

    def __init__(self, array: Path, frames: int) -> None:
        self._place = array / SHARD
        self._index = self._read_index(frames)

    def chunks(self, numbers: Iterable[int]) -> Iterable[bytes | None]:
        """The frames as they were written, None for each that cannot be read; BeyondLimitError if one is too large."""
        if self._index is None:
            yield from (None for _ in numbers)
            return
        with self._place.open("rb") as file:
            for number in numbers:
                start, size = self._index[number].tolist()
                if start == MISSING:
                    yield None
                    continue
                refuse_beyond("image_bytes", size, self._place)
                yield self._read(file, start, size)

    @staticmethod
    def _read(file: BinaryIO, start: int, size: int) -> bytes | None:
        try:
            file.seek(start)
            return file.read(size)
        except (OSError, ValueError, OverflowError):
            return None

    def _read_index(self, frames: int) -> NDArray[np.uint64] | None:
        size = 16 * frames
        try:
            with self._place.open("rb") as file:
                file.seek(-size - CHECKSUM_BYTES, os.SEEK_END)
                index, checksum = file.read(size), file.read()
        except (OSError, ValueError):
            return None
        if google_crc32c.value(index) != int.from_bytes(checksum, "little"):
            return None
        return np.frombuffer(index, "<u8").reshape(frames, 2)
