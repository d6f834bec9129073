"""Frames in files of their own: a folder of PNG or JPEG images in name order, or a single one."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from footscan.frames.image import image_size, refused_image
from schemas.base.errors import Fault, RefusedInput
from schemas.base.image_size import ImageSize
from schemas.base.limits import read_bounded, refuse_beyond
from schemas.frames import Encoding


@dataclass(frozen=True)
class ImageFiles:
    """A `FrameReader` of images, each a frame; an empty file is a lost one."""

    path: Path
    files: Sequence[Path]
    size: ImageSize
    encoding: Encoding = "image"

    @property
    def count(self) -> int:
        return len(self.files)

    def stored(self, numbers: Iterable[int] | None = None) -> Iterator[bytes | None]:
        files = self.files if numbers is None else (self.files[number] for number in numbers)
        yield from (read_bounded(file, "image_bytes") or None for file in files)


def open_images(path: Path, files: Sequence[Path]) -> ImageFiles:
    """The images `files`, which make up the film `path`; RefusedInput where they are none, or differ in size."""
    refuse_beyond("film_frames", len(files), path)
    try:
        sizes = {file: _image_size(file) for file in files}
    except OSError as error:
        raise Fault(f"{path}: cannot be read ({error.strerror or error})") from None
    expected = sizes[files[0]]
    for file, size in sizes.items():
        if size != expected:
            problem = f"expected {expected} pixels as in {files[0].name}, found {size}"
            raise RefusedInput(file, problem, field="frame size")
    return ImageFiles(path, files, expected)


def _image_size(file: Path) -> ImageSize:
    try:
        return image_size(read_bounded(file, "image_bytes"))
    except ValueError as error:
        raise refused_image(file, error) from None
