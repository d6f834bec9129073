"""The Zarr codec whose chunks are images."""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simplejpeg
import zarr

from footscan.frames.codec import ImageCodec
from footscan.frames.image import decode_image
from footscan.frames.ingest import ingest_background, ingest_film
from schemas.base.image_size import ImageSize

PAGE = Path(__file__).parents[3] / "docs/frames.md"
BESIDE_FOOTSCAN, WITHOUT_FOOTSCAN, PIECE = re.findall(
    r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL
)
NO_FOOTSCAN = """
import importlib.metadata, sys
sys.modules["footscan"] = sys.modules["schemas"] = None
importlib.metadata.entry_points = importlib.metadata.EntryPoints
"""
LIGHT = """
import sys
import numpy, simplejpeg, zarr
before = set(sys.modules)
from footscan.frames.codec import ImageCodec
from footscan.frames.image import decode_image
assert decode_image(open(sys.argv[1], "rb").read()).shape == (48, 64, 3)
others = {name.partition(".")[0] for name in set(sys.modules) - before} - sys.stdlib_module_names
assert others <= {"footscan", "schemas"}, others
"""


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
    [codec] = array.metadata.codecs
    assert codec.to_dict() == {"name": "https://footscan.invalid/zarr/image"}
    assert re.fullmatch(r"https?:\/\/[^/?#]+[^?#]*", codec.to_dict()["name"]), "ZEP 9: names that are in no registry"


def test_reads_a_jpeg_that_lies_there(tmp_path: Path, jpeg: Callable[..., bytes]) -> None:
    array = create(tmp_path / "a")
    chunk = tmp_path / "a/c/0/0/0/0"
    chunk.parent.mkdir(parents=True)
    chunk.write_bytes(jpeg(4))
    np.testing.assert_array_equal(array[0], simplejpeg.decode_jpeg(jpeg(4), "RGB"))
    chunk.write_bytes(jpeg(4, 32, 32))
    with pytest.raises(ValueError, match="reshape"):
        array[0]


def test_an_array_under_the_former_name_is_read(tmp_path: Path, pixels: Callable[..., Any]) -> None:
    create(tmp_path / "a")[1] = pixels(1)
    metadata = tmp_path / "a/zarr.json"
    metadata.write_text(metadata.read_text().replace("https://footscan.invalid/zarr/image", "footscan.image"))
    np.testing.assert_array_equal(zarr.open_array(str(tmp_path / "a"), mode="r")[1], pixels(1))


def test_decoding_takes_zarr_numpy_and_a_jpeg_decoder_alone(tmp_path: Path, jpeg: Callable[..., bytes]) -> None:
    (tmp_path / "a.jpg").write_bytes(jpeg(1))
    subprocess.run([sys.executable, "-c", LIGHT, str(tmp_path / "a.jpg")], check=True)


@pytest.fixture
def group(tmp_path: Path, jpeg: Callable[..., bytes], write_mjpeg: Callable[..., Path]) -> Path:
    """Two films of twelve frames, one with a background of one frame and one with its own of twelve."""
    films = [write_mjpeg(tmp_path / f"{length}.avi", [jpeg(k) for k in range(length)]) for length in (1, 12)]
    place, size = tmp_path / "frames.zarr", ImageSize(rows=48, columns=64)
    for camera, background in enumerate(films):
        ingest_film(films[1], place / f"cam{camera}", size)
        ingest_background(background, place / f"cam{camera}-background", 12, size)
    return place


@pytest.mark.parametrize(
    "code", [BESIDE_FOOTSCAN, WITHOUT_FOOTSCAN, NO_FOOTSCAN + WITHOUT_FOOTSCAN], ids=["beside", "own", "without"]
)
def test_the_examples_of_the_page(group: Path, code: str, jpeg: Callable[..., bytes]) -> None:
    shown = subprocess.run([sys.executable, "-c", code], cwd=group.parent, check=True, capture_output=True, text=True)
    assert shown.stdout.startswith(str(decode_image(jpeg(10)).mean(axis=(0, 1))))


def test_a_frame_is_a_piece_of_the_file(group: Path, jpeg: Callable[..., bytes]) -> None:
    code = PIECE.replace("frames, wanted = 200, 12", "frames, wanted = 12, 10")
    assert code != PIECE
    subprocess.run([sys.executable, "-c", code], cwd=group.parent, check=True)
    assert (group.parent / "12.jpg").read_bytes() == jpeg(10)


def test_dimensions_of_one_name_have_one_length(group: Path) -> None:
    lengths: dict[str, set[int]] = {}
    for _, array in zarr.open_group(str(group), mode="r").arrays():
        for name, length in zip(array.metadata.dimension_names, array.shape, strict=True):
            lengths.setdefault(name, set()).add(length)
    assert lengths == {"frame": {12}, "single_frame": {1}, "row": {48}, "column": {64}, "rgb": {3}}


def test_xarray_opens_the_group(group: Path, jpeg: Callable[..., bytes]) -> None:
    xarray = pytest.importorskip("xarray", reason="not among our own dependencies")
    opened = xarray.open_zarr(str(group), consolidated=False)
    np.testing.assert_array_equal(opened["cam0-background"][0], decode_image(jpeg(0)))
    np.testing.assert_array_equal(opened["cam1"][3], decode_image(jpeg(3)))
