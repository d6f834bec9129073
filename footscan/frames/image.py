"""Encoded images to pixels and back: JPEG by libjpeg-turbo, PNG by Pillow.

How chroma is brought up to full size decides the accuracy of a red stripe: libjpeg-turbo interpolates it ("fancy
upsampling"), where ffmpeg, and so the video readers built on it, repeats samples.
"""

import hashlib
import io
from pathlib import Path

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from schemas.base.errors import RefusedInput
from schemas.base.image_size import ImageSize
from schemas.base.limits import BeyondLimitError, beyond, limit

Rgb = NDArray[np.uint8]
"""(rows, columns, 3) uint8: red, green, blue."""

SUFFIXES = (".jpg", ".jpeg", ".png")
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


class TooManyPixelsError(ValueError):
    """An image beyond its bound, see `schemas.base.limits`."""


def refused_image(path: Path, error: ValueError) -> RefusedInput:
    """What to raise of a file that is no image, or a too large one, as `decode_image` and `image_size` say."""
    if isinstance(error, TooManyPixelsError):
        return BeyondLimitError(path, str(error))
    return RefusedInput(path, f"expected a JPEG or PNG image ({error})")


def pixel_buffer(rows: int, columns: int) -> Rgb:
    """Memory for frames: (rows, columns, 3), a view of (rows, columns, 4), in which a pixel is one word of memory."""
    return np.zeros((rows, columns, 4), np.uint8)[..., :3]


def padded_pixels(image: Rgb) -> NDArray[np.uint8] | None:
    """The (rows, columns, 4) memory of an image that fills a `pixel_buffer`; None for any other image."""
    rows, columns, _ = image.shape
    padded = image.base
    if (
        isinstance(padded, np.ndarray)
        and padded.dtype == np.uint8
        and padded.shape == (rows, columns, 4)
        and padded.flags.c_contiguous
        and image.strides == padded.strides
        and image.__array_interface__["data"] == padded.__array_interface__["data"]
    ):
        return padded
    return None


def decode_image(data: bytes, buffer: Rgb | None = None) -> Rgb:
    """The pixels of a JPEG or PNG image.

    Parameters
    ----------
    data : bytes
        The encoded image. Huffman tables may be missing, as they do in Motion-JPEG.
    buffer : (rows, columns, 3) uint8, optional
        A `pixel_buffer`, written to and returned where its shape fits, so that a film is decoded into one place.

    Raises
    ------
    ValueError
        `data` is no such image, or a torn one.
    """
    size = image_size(data)
    if _is_jpeg(data):
        return _decode_jpeg(data, buffer if buffer is not None and buffer.shape == (*size, 3) else None)
    return _decode_png(data)


def image_size(data: bytes) -> ImageSize:
    """Size of an encoded image, without decoding its pixels; ValueError as in `decode_image`."""
    if _is_jpeg(data):
        try:
            rows, columns, _, _ = simplejpeg.decode_jpeg_header(data, strict=False)
        except KeyError:  # a colour space or a subsampling that there is not
            raise ValueError("a torn JPEG header") from None
    elif data[:8] == PNG_SIGNATURE and data[12:16] == b"IHDR" and len(data) >= 24:
        rows, columns = int.from_bytes(data[20:24], "big"), int.from_bytes(data[16:20], "big")
    else:
        raise ValueError("neither JPEG nor PNG")
    if rows < 1 or columns < 1:
        raise ValueError(f"{columns} x {rows} pixels")
    if rows * columns > limit("image_pixels"):
        raise TooManyPixelsError(f"{columns} x {rows} pixels: {beyond('image_pixels', rows * columns)}")
    return ImageSize(int(rows), int(columns))


def encode_png(pixels: Rgb) -> bytes:
    """`pixels` as PNG, the lossless counterpart of `decode_image`."""
    from PIL import Image

    out = io.BytesIO()
    Image.fromarray(pixels).save(out, format="PNG")
    return out.getvalue()


def _is_jpeg(data: bytes) -> bool:
    return data[:2] == b"\xff\xd8"


def _decode_jpeg(data: bytes, buffer: Rgb | None) -> Rgb:
    padded = None if buffer is None else padded_pixels(buffer)
    colours = "RGB" if padded is None else "RGBA"
    try:
        pixels = simplejpeg.decode_jpeg(data, colours, buffer=padded)
    except ValueError as error:
        # Webcams pad their entropy-coded data; every pixel is there nevertheless.
        if "extraneous" not in str(error):
            raise
        pixels = simplejpeg.decode_jpeg(data, colours, strict=False, buffer=padded)
    return np.asarray(pixels) if buffer is None or padded is None else buffer


def _decode_png(data: bytes) -> Rgb:
    from PIL import Image  # not needed to read a camera's JPEGs

    Image.MAX_IMAGE_PIXELS = None  # `schemas.base.limits` bounds them; Pillow would warn at half of its own bound
    try:
        with Image.open(io.BytesIO(data), formats=("PNG",)) as image:
            if image.mode in {"I", "I;16", "I;16B"}:  # grey of 16 bits, which Pillow would clip to 8
                return np.stack([(np.asarray(image).astype(np.uint32) >> 8).astype(np.uint8)] * 3, axis=-1)
            return np.asarray(image.convert("RGB"))
    except (OSError, SyntaxError, IndexError) as error:
        raise ValueError(f"a torn PNG image ({error})") from None


def decode_or_none(data: bytes | None, buffer: Rgb) -> Rgb | None:
    """The frame `data` decoded into `buffer`; None where it is lost, torn or of another size."""
    try:
        pixels = None if data is None else decode_image(data, buffer)
    except ValueError:
        return None
    return pixels if pixels is not None and pixels.shape == buffer.shape else None


def frame_digest(frame: bytes | Rgb) -> str:
    """SHA-256 of a frame's bytes."""
    return hashlib.sha256(frame if isinstance(frame, bytes) else np.ascontiguousarray(frame).data).hexdigest()
