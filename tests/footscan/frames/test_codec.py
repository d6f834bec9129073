"""The Zarr codec whose chunks are images."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simplejpeg
import zarr

from footscan.frames.codec import ImageCodec
from footscan.frames.image import decode_image


def create(path: Path) -> Any:
    return zarr.create_array(
        str(path), shape=(3, 48, 64, 3), chunks=(1, 48, 64, 3), dtype="uint8", serializer=ImageCodec(), compressors=None
    )


def test_writes_png_and_reads_it_back(tmp_path: Path, pixels: Callable[..., Any]) -> None:
    array = create(tmp_path / "a")
    array[1] = pixels(1)
    stored = (tmp_path / "a/c/1/0/0/0").read_bytes()
    assert stored.startswith(b"\x89PNG")
    np.testing.assert_array_equal(decode_image(stored), pixels(1))
    opened = zarr.open_array(str(tmp_path / "a"), mode="r")
    np.testing.assert_array_equal(opened[1], pixels(1))
    np.testing.assert_array_equal(opened[1, 5:9, ::7, 0], pixels(1)[5:9, ::7, 0])
    assert not opened[0].any()


def test_metadata_name_the_codec_and_nothing_else(tmp_path: Path) -> None:
    array = create(tmp_path / "a")
    assert [codec.to_dict() for codec in array.metadata.codecs] == [{"name": "footscan.image"}]
    assert ImageCodec.from_dict({"name": "footscan.image"}) == ImageCodec()


def test_reads_a_jpeg_that_lies_there(tmp_path: Path, jpeg: Callable[..., bytes]) -> None:
    array = create(tmp_path / "a")
    chunk = tmp_path / "a/c/0/0/0/0"
    chunk.parent.mkdir(parents=True)
    chunk.write_bytes(jpeg(4))
    np.testing.assert_array_equal(array[0], simplejpeg.decode_jpeg(jpeg(4), "RGB"))
    chunk.write_bytes(jpeg(4, 32, 32))
    with pytest.raises(ValueError, match="reshape"):
        array[0]
