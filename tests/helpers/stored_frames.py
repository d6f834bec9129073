"""Frames as they lie in an array, and harm to them."""

import json
from pathlib import Path

from footscan.frames.array import chunks_of
from footscan.frames.shard import ShardWriter


def frames_of(array: Path) -> list[bytes | None]:
    """The bytes of all frames, None for those that are lost."""
    count = json.loads((array / "zarr.json").read_bytes())["shape"][0]
    return list(chunks_of(array, count, range(count)))


def frame_bytes(array: Path, number: int) -> bytes:
    """The bytes of one frame."""
    frame = frames_of(array)[number]
    assert frame is not None, f"{array}: frame {number} is lost"
    return frame


def put_frame(array: Path, number: int, data: bytes | None) -> None:
    """Write other bytes for one frame, or none, past the manifest."""
    frames = frames_of(array)
    frames[number] = data
    with ShardWriter(array, len(frames)) as shard:
        for each, frame in enumerate(frames):
            if frame is not None:
                shard.add(each, frame)
