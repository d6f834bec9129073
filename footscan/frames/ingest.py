"""A film into a Zarr array `(frame, row, column, rgb)`, one frame a chunk.

An array is written beside its place and renamed when it is whole: what has its name is complete.
"""

import contextlib
import errno
import os
import shutil
import socket
import threading
from pathlib import Path

import zarr
from zarr.codecs import BloscCodec
from zarr.errors import ContainsGroupError

from footscan.frames.codec import ImageCodec
from footscan.frames.film import encoded_frames, frame_digest, open_film, pixel_frames
from schemas.errors import Fault
from schemas.frames import FrameManifest

FRAME_SIZE = (480, 640)
"""(rows, columns) of a recorded scan's frames."""


def ingest_film(film: Path, array: Path, size: tuple[int, int] | None = FRAME_SIZE) -> FrameManifest:
    """Write the frames of `film` as the Zarr array `array`, in place of what is there.

    JPEG and PNG frames keep their bytes; raw ones are compressed without loss.

    Parameters
    ----------
    film : Path
        An AVI or a folder of images.
    array : Path
        Folder of the array, e.g. `SCAN/frames.zarr/cam1`; its parent becomes a Zarr group.
    size : (rows, columns), optional
        Expected size of the frames.

    Raises
    ------
    RefusedInput
        The film is missing, truncated, or not of this size.
    Fault
        The array cannot be written; nothing that looks whole is left.
    """
    opened = open_film(film, size)
    partial = _partial_folder(array)
    try:
        array.parent.mkdir(parents=True, exist_ok=True)
        _sweep(array.parent.parent)
        shutil.rmtree(partial, ignore_errors=True)
        target = zarr.create_array(
            store=str(partial),
            shape=(opened.frames, opened.height, opened.width, 3),
            chunks=(1, opened.height, opened.width, 3),
            dtype="uint8",
            fill_value=0,
            dimension_names=("frame", "row", "column", "rgb"),
            chunk_key_encoding={"name": "v2", "separator": "."},  # one flat folder of images
            **(
                {"compressors": BloscCodec(cname="zstd", clevel=5, shuffle="bitshuffle")}
                if opened.kind == "raw"
                else {"serializer": ImageCodec(), "compressors": None}
            ),
        )
        digests: list[str | None] = []
        if opened.kind == "raw":
            for number, pixels in enumerate(pixel_frames(opened)):
                digests.append(None if pixels is None else frame_digest(pixels))
                if pixels is not None:
                    target[number] = pixels
        else:
            for number, data in enumerate(encoded_frames(opened)):
                digests.append(None if data is None else frame_digest(data))
                if data is not None:
                    (partial / chunk_name(number)).write_bytes(data)
        manifest = FrameManifest(
            encoding="pixels" if opened.kind == "raw" else "image",
            height=opened.height,
            width=opened.width,
            frames=digests,
        )
        target.update_attributes({"footscan": manifest.model_dump(mode="json"), "film": film.name})
        _move_into_place(partial, array)
        with contextlib.suppress(ContainsGroupError):  # another camera's thread was first
            zarr.open_group(str(array.parent), mode="a")
    except OSError as error:
        raise Fault(f"{array}: cannot be written ({error.strerror or error})") from None
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return manifest


def chunk_name(frame: int) -> str:
    """File of one frame within its array."""
    return f"{frame}.0.0.0"


def is_complete(array: Path) -> bool:
    """Whether a whole array is there; what it holds is checked frame by frame on reading."""
    return (array / "zarr.json").is_file()


def discard(array: Path) -> None:
    """Take back the completeness of an array that was found damaged."""
    (array / "zarr.json").unlink(missing_ok=True)


def _partial_folder(array: Path) -> Path:
    """Outside of the group, so that no reader of it meets a part; one for each thread that ingests."""
    return array.parent.parent / f".{array.name}.partial-{socket.gethostname()}-{threading.get_ident()}-{os.getpid()}"


def _move_into_place(partial: Path, array: Path) -> None:
    """Give `partial` the name `array`. A folder cannot be renamed onto another: the old one steps aside first.

    Others may ingest the same array meanwhile; whoever comes last stays.
    """
    aside = partial.with_name(partial.name + ".old")
    while True:
        try:
            partial.rename(array)
            return
        except OSError as error:
            if error.errno not in {errno.EEXIST, errno.ENOTEMPTY, errno.ENOTDIR}:
                raise
        with contextlib.suppress(FileNotFoundError):  # another was faster
            array.rename(aside)
            _remove(aside)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _sweep(folder: Path) -> None:
    """Remove the parts that interrupted processes of this machine have left."""
    for part in folder.glob(f".*.partial-{socket.gethostname()}-*"):
        pid = part.name.removesuffix(".old").rpartition("-")[2]
        if pid.isdigit() and not Path(f"/proc/{pid}").exists() and Path("/proc/self").exists():
            shutil.rmtree(part, ignore_errors=True)
