"""Frames of an AVI, Motion-JPEG or raw: the packets are taken out of it untouched.

A frame that is lost or torn keeps its number, for its number is its X.
"""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from footscan.frames.image import Rgb
from schemas.base.errors import Fault, RefusedInput
from schemas.base.image_size import ImageSize
from schemas.base.limits import refuse_beyond
from schemas.frames import Encoding

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.video.stream import VideoStream

_Numbered = tuple[int, bytes | Rgb | None]

ENCODINGS: Mapping[str, Encoding] = {"mjpeg": "image", "rawvideo": "pixels"}
"""What the codecs of the films are, by FFmpeg's names of them."""


@dataclass(frozen=True)
class AviFilm:
    """A `FrameReader` of an AVI, which is read from its beginning to its end."""

    path: Path
    count: int
    size: ImageSize
    encoding: Encoding
    """`image`: an AVI of JPEG packets; `pixels`: one of plain pixels."""

    def stored(self, numbers: Iterable[int] | None = None) -> Iterator[bytes | Rgb | None]:
        wanted = range(self.count) if numbers is None else set(numbers)
        next_number = 0
        filmed: Iterator[_Numbered] = _packets(self.path) if self.encoding == "image" else _raw_frames(self.path)
        for number, frame in chain(filmed, [(self.count, None)]):
            yield from (None for gap in range(next_number, number) if gap in wanted)
            if number in wanted:
                yield frame
            next_number = number + 1
            if numbers is not None and next_number > max(wanted, default=-1):
                return  # nothing behind the last one is read


def open_avi(path: Path) -> AviFilm:
    """Look at an AVI without decoding its frames; RefusedInput where it is none, truncated, or of another codec."""
    try:
        fewest, most = _declared_length(path)
    except OSError as error:
        raise Fault(f"{path}: cannot be read ({error.strerror or error})") from None
    with _container(path) as (container, stream):
        codec = stream.codec_context.name if stream.codec_context else "an unknown codec"
        if codec not in ENCODINGS:
            raise RefusedInput(path, f"expected Motion-JPEG or raw video, found {codec}", field="codec")
        size = ImageSize(stream.height, stream.width)
        refuse_beyond("image_pixels", size.rows * size.columns, path)
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
    return AviFilm(path, found, size, ENCODINGS[codec])


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


def _packets(path: Path) -> Iterator[tuple[int, bytes]]:
    with _container(path) as (container, stream):
        for packet in container.demux(stream):
            if packet.size:
                yield _number(packet.pts, stream), bytes(packet)


def _raw_frames(path: Path) -> Iterator[tuple[int, Rgb]]:
    with _container(path) as (container, stream):
        for frame in container.decode(stream):
            yield _number(frame.pts, stream), np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)
