"""Frames of one camera, wherever they lie: what every source of them offers, and the one way to decode them."""

from collections.abc import Iterable, Iterator
from itertools import repeat
from pathlib import Path
from typing import Protocol

from footscan.frames.image import Rgb, decode_or_none, pixel_buffer
from schemas.base.image_size import ImageSize
from schemas.frames import Encoding


class FrameReader(Protocol):
    """A film, a folder of images or a Zarr array. `footscan.frames.film.open_film` opens one, and reads no frames.

    path : where the frames lie
    size : rows and columns of each
    count : number of frames, those that are lost included
    encoding : `image`, the frames are JPEG or PNG images; `pixels`, they are plain pixels
    """

    @property
    def path(self) -> Path: ...
    @property
    def size(self) -> ImageSize: ...
    @property
    def count(self) -> int: ...
    @property
    def encoding(self) -> Encoding: ...

    def stored(self, numbers: Iterable[int] | None = None) -> Iterator[bytes | Rgb | None]:
        """The frames as they lie there, None for each that is lost: all, or those of these ascending `numbers`.

        Bytes of an image, or (rows, columns, 3) pixels, as `encoding` says.
        """


def pixel_frames(reader: FrameReader, numbers: Iterable[int] | None = None) -> Iterator[Rgb | None]:
    """The frames as (rows, columns, 3) uint8, each valid until the next; None for a lost or torn one.

    `numbers` : of the frames to read, ascending; default: all.
    """
    buffer = pixel_buffer(*reader.size)
    for frame in reader.stored(numbers):
        yield decode_or_none(frame, buffer) if isinstance(frame, bytes) else frame


def noting_lost(frames: Iterable[Rgb | None], lost: list[int]) -> Iterator[Rgb | None]:
    """The same frames; the numbers of lost ones are added to `lost`."""
    for number, frame in enumerate(frames):
        if frame is None:
            lost.append(number)
        yield frame


def backgrounds_of(background: FrameReader, frames: int) -> Iterator[Rgb | None]:
    """The laser-off frame of each of so many `frames`: its own, or the only one, which is read once, for all."""
    backgrounds = pixel_frames(background)
    return backgrounds if background.count == frames else repeat(next(backgrounds), frames)
