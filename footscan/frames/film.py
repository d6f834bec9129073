"""Films as they come: AVI (Motion-JPEG or raw), a folder of images, a single image, an array recorded frame by frame.

The packets are taken out of the AVI untouched. A frame that is lost or torn keeps its number, for its number is its X.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, TypeVar

import numpy as np

from footscan.frames.array import damage, is_complete, read_manifest, stored_bytes
from footscan.frames.image import SUFFIXES, Rgb, decode_or_none, frame_digest, image_size, pixel_buffer, refused_image
from schemas.base.errors import Fault, RefusedInput
from schemas.base.limits import read_bounded, refuse_beyond

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.video.stream import VideoStream

_Frame = TypeVar("_Frame", bytes, Rgb)


@dataclass(frozen=True)
class Film:
    """What a film holds."""

    path: Path
    kind: str
    """`mjpeg`: an AVI of JPEG packets; `raw`: an AVI of plain pixels; `images`: a folder of them, or one; `array`: a
    Zarr array of ours, of encoded images."""
    frames: int
    height: int
    width: int


def open_film(path: Path, size: tuple[int, int] | None = None) -> Film:
    """Look at a film without reading its frames.

    Parameters
    ----------
    path : Path
        An AVI, a folder of PNG or JPEG images in name order, one image, or an array of encoded images.
    size : (rows, columns), optional
        Expected size of the frames.

    Raises
    ------
    RefusedInput
        Missing, empty, truncated, of another kind or another size.
    """
    film = _open_film(path)
    if size is not None and (film.height, film.width) != size:
        expected = f"expected frames of {size[1]} x {size[0]} pixels, found {film.width} x {film.height}"
        raise RefusedInput(path, expected, field="frame size")
    return film


def open_background(path: Path, size: tuple[int, int], frames: int, whose: str = "the film") -> Film:
    """`open_film` for the laser-off frames of a film of so many `frames`: one for all of them, or as many.

    Raises
    ------
    RefusedInput
        As in `open_film`; there are neither one frame nor as many as `whose` has, or the only one is torn.
    """
    background = open_film(path, size)
    if background.frames not in {1, frames}:
        expected = f"expected one frame or {frames}, as many as {whose} has, found {background.frames}"
        raise RefusedInput(path, expected, field="frames")
    if background.frames == 1 and next(pixel_frames(background)) is None:
        raise RefusedInput(path, "expected a whole frame, found one that is torn", field="frames")
    return background


def encoded_frames(film: Film) -> Iterator[bytes | None]:
    """The frames of a film of kind `mjpeg`, `images` or `array` as they were encoded, None for each that is lost.

    Fault where one of an array is damaged: it is checked against the digest under which it was recorded.
    """
    if film.kind == "array":
        yield from _array_frames(film.path)
        return
    if film.kind == "images":
        yield from (read_bounded(file, "image_bytes") or None for file in image_files(film.path))
        return
    yield from _fill_gaps(_packets(film), film.frames)


def pixel_frames(film: Film) -> Iterator[Rgb | None]:
    """The frames of any film as (rows, columns, 3) arrays, each valid until the next; None for a lost or torn one."""
    if film.kind == "raw":
        yield from _fill_gaps(_raw_frames(film), film.frames)
        return
    buffer = pixel_buffer(film.height, film.width)
    for data in encoded_frames(film):
        yield decode_or_none(data, buffer)


def image_files(path: Path) -> list[Path]:
    """The images in a folder in name order, or the one image that `path` is."""
    if not path.is_dir():
        return [path]
    return sorted(f for f in path.iterdir() if f.suffix.lower() in SUFFIXES and not f.name.startswith("."))


def film_files(path: Path) -> list[Path]:
    """The files that make up a film; RefusedInput where there are none.

    Of an array that is the one which holds its manifest, and so the digest of every frame.
    """
    if is_complete(path):
        return [path / "zarr.json"]
    try:
        files = image_files(path)
        for file in files:
            if file != path and not file.is_file():
                raise RefusedInput(file, "expected an image, found a folder or another thing that is no file")
        if files and files[0].is_file():
            return files
    except OSError as error:
        raise RefusedInput(path, error.strerror or "cannot be read") from None
    raise RefusedInput(path, "no PNG or JPEG images in this folder" if path.is_dir() else "no such film")


def _open_film(path: Path) -> Film:
    if is_complete(path):
        return _open_array(path)
    files = film_files(path)
    return _open_avi(path) if files == [path] and path.suffix.lower() not in SUFFIXES else _open_images(path, files)


def _open_array(path: Path) -> Film:
    manifest = read_manifest(path)
    if manifest.encoding != "image":
        raise RefusedInput(path, "expected an array of encoded images, found one of pixels", field="encoding")
    if not manifest.frames:
        raise RefusedInput(path, "expected at least one frame, found none", field="frames")
    return Film(path, "array", len(manifest.frames), manifest.height, manifest.width)


def _open_images(path: Path, files: list[Path]) -> Film:
    refuse_beyond("film_frames", len(files), path)
    try:
        sizes = {file: _image_size(file) for file in files}
    except OSError as error:
        raise Fault(f"{path}: cannot be read ({error.strerror or error})") from None
    rows, columns = sizes[files[0]]
    for file, size in sizes.items():
        if size != (rows, columns):
            expected = f"expected {columns} x {rows} pixels as in {files[0].name}, found {size[1]} x {size[0]}"
            raise RefusedInput(file, expected, field="frame size")
    return Film(path, "images", len(files), rows, columns)


def _image_size(file: Path) -> tuple[int, int]:
    try:
        return image_size(read_bounded(file, "image_bytes"))
    except ValueError as error:
        raise refused_image(file, error) from None


def _open_avi(path: Path) -> Film:
    try:
        fewest, most = _declared_length(path)
    except OSError as error:
        raise Fault(f"{path}: cannot be read ({error.strerror or error})") from None
    with _container(path) as (container, stream):
        codec = stream.codec_context.name if stream.codec_context else "an unknown codec"
        kind = {"mjpeg": "mjpeg", "rawvideo": "raw"}.get(codec)
        if kind is None:
            raise RefusedInput(path, f"expected Motion-JPEG or raw video, found {codec}", field="codec")
        height, width = stream.height, stream.width
        refuse_beyond("image_pixels", height * width, path)
        numbers = [_number(packet.pts, stream) for packet in container.demux(stream) if packet.size]
    found = max(numbers, default=-1) + 1
    if not numbers:
        raise RefusedInput(path, "expected at least one frame, found none", field="frames")
    refuse_beyond("film_frames", found, path)
    if found < fewest:
        problem = f"truncated: expected the {fewest} frames that its header declares, found {found}"
        raise RefusedInput(path, problem, field="frames")
    if most is not None and found > most:
        problem = f"expected the {most} frames that its header declares, found {found}: their numbers are uncertain"
        raise RefusedInput(path, problem, field="frames")
    return Film(path, kind, found, height, width)


def _declared_length(path: Path) -> tuple[int, int | None]:
    """The fewest and the most frames by an AVI's main header, after a check that all its chunks are there.

    RIFF: a chunk is a tag, its length in 4 bytes, and its content, padded to an even length; a long film is several
    RIFF chunks in a row (OpenDML), and its main header may tell of the first alone. There, and where the recorder has
    left the number out, it is no upper bound.
    """
    length = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(64)
        if head[:4] != b"RIFF" or head[8:12] != b"AVI ":
            raise RefusedInput(path, "expected an AVI film", field="header")
        if head[24:28] != b"avih" or len(head) < 56:
            raise RefusedInput(path, "expected an AVI main header, found a torn file", field="header")
        position = chunks = 0
        while position + 8 <= length:
            file.seek(position)
            tag = file.read(4)
            if tag != b"RIFF":
                break  # padding behind the film
            size = int.from_bytes(file.read(4), "little")
            if size in {0, 0xFFFFFFFF}:
                raise RefusedInput(path, "never finished by its recorder: its length is not written", field="header")
            position += 8 + size + size % 2
            chunks += 1
            if position - size % 2 > length:
                missing = position - size % 2 - length
                raise RefusedInput(path, f"truncated: {missing} of {position} bytes are missing", field="length")
            _refuse_large_frames(file, path, position - 8 - size - size % 2, position)
    declared = int.from_bytes(head[48:52], "little")
    return declared, declared if declared and chunks == 1 else None


def _refuse_large_frames(file: BinaryIO, path: Path, begin: int, end: int) -> None:
    """Refuses a RIFF chunk with frames larger than an image may be: FFmpeg would read each as a whole."""
    position, chunks = begin + 12, 0
    while position + 8 <= end:
        file.seek(position)
        tag, size, kind = file.read(4), int.from_bytes(file.read(4), "little"), file.read(4)
        chunks += 1
        if tag == b"LIST" and kind in {b"movi", b"rec "}:
            position += 12  # its chunks follow
            continue
        if tag[2:] in {b"dc", b"db"}:
            refuse_beyond("image_bytes", size, path)
        refuse_beyond("film_chunks", chunks, path)
        position += 8 + size + size % 2


@contextmanager
def _container(path: Path) -> "Iterator[tuple[InputContainer, VideoStream]]":
    """An AVI opened by PyAV, with its first video stream; its errors as RefusedInput."""
    import av  # 0.1 s that other commands need not wait for

    try:
        with av.open(str(path), "r", format="avi", metadata_errors="replace") as container:
            if not container.streams.video:
                raise RefusedInput(path, "expected a video stream, found none", field="streams")
            yield container, container.streams.video[0]
    except av.FFmpegError as error:
        raise RefusedInput(path, f"expected an AVI film ({error.strerror or error})") from None


def _number(pts: int | None, stream: "VideoStream") -> int:
    """The frame's number from its time stamp: a packet that was lost leaves a gap there."""
    rate = stream.average_rate or stream.base_rate
    base = stream.time_base
    if pts is None or base is None or not rate:
        raise RefusedInput(stream.container.name, "expected a time stamp at each frame", field="frames")
    return round(Fraction(pts) * base * rate)


def _packets(film: Film) -> Iterator[tuple[int, bytes]]:
    with _container(film.path) as (container, stream):
        for packet in container.demux(stream):
            if packet.size:
                yield _number(packet.pts, stream), bytes(packet)


def _array_frames(array: Path) -> Iterator[bytes | None]:
    for number, digest in enumerate(read_manifest(array).frames):
        data = None if digest is None else stored_bytes(array, number)
        if digest is not None and (data is None or frame_digest(data) != digest):
            raise damage(array, number)
        yield data


def _raw_frames(film: Film) -> Iterator[tuple[int, Rgb]]:
    with _container(film.path) as (container, stream):
        for frame in container.decode(stream):
            yield _number(frame.pts, stream), np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)


def _fill_gaps(numbered: Iterator[tuple[int, _Frame]], frames: int) -> Iterator[_Frame | None]:
    next_number = 0
    for number, frame in numbered:
        yield from (None for _ in range(next_number, number))
        yield frame
        next_number = number + 1
    yield from (None for _ in range(next_number, frames))
