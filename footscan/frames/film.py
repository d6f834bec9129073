"""Films as they come: an AVI, a folder of images, a single image, or an array that was recorded frame by frame."""

from pathlib import Path

from footscan.frames.array import METADATA, StoredFrames, is_complete, read_manifest
from footscan.frames.avi import open_avi
from footscan.frames.image import SUFFIXES
from footscan.frames.image_files import open_images
from footscan.frames.reader import FrameReader, pixel_frames
from schemas.base.errors import RefusedInput
from schemas.base.image_size import SMALLEST_FRAME, ImageSize


def open_film(path: Path, size: ImageSize | None = None) -> FrameReader:
    """Look at a film without reading its frames.

    Parameters
    ----------
    path : Path
        An AVI, a folder of PNG or JPEG images in name order, one image, or an array of encoded images.
    size : ImageSize, optional
        Expected size of the frames.

    Raises
    ------
    RefusedInput
        Missing, empty, truncated, of another kind or another size.
    """
    film = _open_film(path)
    if size is not None and film.size != size:
        raise RefusedInput(path, f"expected frames of {size} pixels, found {film.size}", field="frame size")
    return film


def open_camera_film(path: Path) -> FrameReader:
    """`open_film` for a film of a scanner's camera, of any size from 320 x 240 up.

    Raises
    ------
    RefusedInput
        As in `open_film`; or the frames are smaller.
    """
    film = open_film(path)
    if film.size.rows < SMALLEST_FRAME.rows or film.size.columns < SMALLEST_FRAME.columns:
        problem = f"expected frames of at least {SMALLEST_FRAME} pixels, found {film.size}"
        raise RefusedInput(path, problem, field="frame size")
    return film


def open_background(path: Path, size: ImageSize, frames: int, whose: str = "the film") -> FrameReader:
    """`open_film` for the laser-off frames of a film of so many `frames`: one for all of them, or as many.

    Raises
    ------
    RefusedInput
        As in `open_film`; there are neither one frame nor as many as `whose` has, or the only one is torn.
    """
    background = open_film(path, size)
    if background.count not in {1, frames}:
        expected = f"expected one frame or {frames}, as many as {whose} has, found {background.count}"
        raise RefusedInput(path, expected, field="frames")
    if background.count == 1 and next(pixel_frames(background)) is None:
        raise RefusedInput(path, "expected a whole frame, found one that is torn", field="frames")
    return background


def film_files(path: Path) -> list[Path]:
    """The files that make up a film; RefusedInput where there are none.

    Of an array that is the one which holds its manifest, and so the digest of every frame.
    """
    if is_complete(path):
        return [path / METADATA]
    try:
        files = _image_files(path) if path.is_dir() else [path]
        for file in files:
            if file != path and not file.is_file():
                raise RefusedInput(file, "expected an image, found a folder or another thing that is no file")
        if files and files[0].is_file():
            return files
    except OSError as error:
        raise RefusedInput(path, error.strerror or "cannot be read") from None
    raise RefusedInput(path, "no PNG or JPEG images in this folder" if path.is_dir() else "no such film")


def _open_film(path: Path) -> FrameReader:
    if is_complete(path):
        return _open_array(path)
    files = film_files(path)
    return open_avi(path) if files == [path] and path.suffix.lower() not in SUFFIXES else open_images(path, files)


def _open_array(path: Path) -> FrameReader:
    array = StoredFrames(path, read_manifest(path))
    if array.encoding != "image":
        raise RefusedInput(path, "expected an array of encoded images, found one of pixels", field="encoding")
    if not array.count:
        raise RefusedInput(path, "expected at least one frame, found none", field="frames")
    return array


def _image_files(folder: Path) -> list[Path]:
    return sorted(f for f in folder.iterdir() if f.suffix.lower() in SUFFIXES and not f.name.startswith("."))
