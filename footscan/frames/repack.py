"""Arrays of earlier versions, one file a frame, into arrays of one shard."""

import json
import os
import tempfile
from pathlib import Path

from footscan.frames.array import METADATA, StoredFrames, chunks_of, is_chunk_name, is_complete, read_manifest
from footscan.frames.ingest import create_array
from footscan.frames.shard import ShardWriter
from schemas.base.errors import Fault
from schemas.frames import FrameManifest


def repack(array: Path) -> int:
    """Gather the frames of an array in one shard; returns the number of files that are fewer than before.

    The frames keep their bytes, and the manifest stays as it is. The shard is written beside the frames, then the
    document that says what the array is gets replaced, and then the old files go: whenever this is interrupted, the
    array is whole, and a further call goes on.

    Parameters
    ----------
    array : folder of the array; one that is not there, or has no manifest yet, is left alone

    Raises
    ------
    RefusedInput
        It is no array of footscan.
    DamagedError, Fault
        A frame is damaged, as of `StoredFrames`; or the disk refuses. The array is left as it was.
    """
    if not is_complete(array):
        return 0
    manifest = read_manifest(array)
    try:
        document = json.loads((array / METADATA).read_bytes())
        if document["codecs"][0]["name"] != "sharding_indexed":
            for _ in StoredFrames(array, manifest).stored():
                pass  # each is checked on reading
            numbers = [number for number, digest in enumerate(manifest.frames) if digest is not None]
            with ShardWriter(array, len(manifest.frames)) as shard:
                for number, chunk in zip(numbers, chunks_of(array, len(manifest.frames), numbers), strict=True):
                    if chunk is None:
                        raise Fault(f"{array}: frame {number} cannot be read any more")
                    shard.add(number, chunk)
            _replace_document(array, document["attributes"], manifest)
        old = [file for file in array.iterdir() if is_chunk_name(file.name)]
        for file in old:
            file.unlink()
    except OSError as error:
        raise Fault(f"{array}: cannot be written ({error.strerror or error})") from None
    return max(len(old) - 1, 0)


def _replace_document(array: Path, attributes: object, manifest: FrameManifest) -> None:
    """Say of an array that its chunks lie in a shard; its attributes stay."""
    place = array / METADATA
    with tempfile.TemporaryDirectory() as folder:
        create_array(Path(folder) / "array", manifest.encoding, len(manifest.frames), manifest.size)
        document = json.loads((Path(folder) / "array" / METADATA).read_bytes())
    partial = place.with_name(f"{METADATA}.partial")
    with partial.open("wb") as file:
        file.write(json.dumps(document | {"attributes": attributes}, indent=2).encode())
        file.flush()
        os.fsync(file.fileno())
    partial.replace(place)
