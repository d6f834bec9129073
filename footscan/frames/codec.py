"""A Zarr v3 codec whose chunks are encoded images: a camera's JPEG lies in the array bit for bit.

Registered with Zarr through the entry point `zarr.codecs`, so that `zarr.open` reads the frames wherever footscan is
installed, be it without its dependencies: this module needs numpy, zarr and simplejpeg, and Pillow for PNG images.
docs/frames.md has a codec for those who do without footscan.
"""

import asyncio
from dataclasses import dataclass
from typing import Self

import numpy as np
from zarr.abc.codec import ArrayBytesCodec
from zarr.core.array_spec import ArraySpec
from zarr.core.buffer import Buffer, NDBuffer
from zarr.core.common import JSON

from footscan.frames.image import decode_image, encode_png

CODEC_NAME = "https://footscan.invalid/zarr/image"
"""A name that is in no registry has to be an HTTP URI (ZEP 9, phase 1); nobody else can own this one (RFC 2606).

Arrays of earlier versions have `footscan.image`, under which the codec is registered too."""


@dataclass(frozen=True)
class ImageCodec(ArrayBytesCodec):
    """One chunk of shape (1, rows, columns, 3), uint8, as one JPEG or PNG image.

    Decodes both. Encodes as PNG, which loses nothing; a camera's JPEG is written to the store as it is.
    """

    is_fixed_size = False

    @classmethod
    def from_dict(cls, data: dict[str, JSON]) -> Self:
        """The codec has no configuration."""
        del data
        return cls()

    def to_dict(self) -> dict[str, JSON]:
        """The codec's name, as Zarr's metadata hold it."""
        return {"name": CODEC_NAME}

    async def _decode_single(self, chunk_data: Buffer, chunk_spec: ArraySpec) -> NDBuffer:
        pixels = await asyncio.to_thread(decode_image, chunk_data.to_bytes())
        return chunk_spec.prototype.nd_buffer.from_numpy_array(pixels.reshape(chunk_spec.shape))

    async def _encode_single(self, chunk_data: NDBuffer, chunk_spec: ArraySpec) -> Buffer:
        pixels = np.asarray(chunk_data.as_ndarray_like(), np.uint8).reshape(chunk_spec.shape[1:])
        return chunk_spec.prototype.buffer.from_bytes(await asyncio.to_thread(encode_png, pixels))

    def compute_encoded_size(self, input_byte_length: int, chunk_spec: ArraySpec) -> int:
        """Not known before an image is encoded."""
        raise NotImplementedError(f"{CODEC_NAME} chunks have no fixed size")
