"""The step from laser-off frames to colours of stripe points."""

from pathlib import Path

import numpy as np
import pytest
import simplejpeg

from footscan.cloud.colour import linear_light
from footscan.frames.ingest import ingest_film
from footscan.stripe.points import STRIPE_DTYPE
from footscan.virtual.filming.film import write_film
from pipelines.arrays import pack, unpack
from pipelines.steps import colour
from schemas.base.errors import DamagedError
from schemas.frames import FrameManifest
from tests.helpers.stored_frames import frame_bytes, put_frame

LEVELS = (60, 120, 180)


def ingested(tmp_path: Path, levels: tuple[int, ...]) -> tuple[Path, FrameManifest]:
    """Frames of one grey each."""
    pictures = [np.full((480, 640, 3), level, np.uint8) for level in levels]
    jpegs = [bytes(simplejpeg.encode_jpeg(picture, 95, "RGB", "444")) for picture in pictures]
    write_film(tmp_path / "off.avi", jpegs, 640, 480, 18)
    array = tmp_path / "frames.zarr" / "cam1-off"
    return array, ingest_film(tmp_path / "off.avi", array)


def coloured(array: Path, manifest: FrameManifest) -> dict[str, np.ndarray]:
    """What the step says of points in frames 0, 2 and 5."""
    stripe = np.zeros(3, STRIPE_DTYPE)
    stripe["frame"], stripe["i"], stripe["j"], stripe["width"] = [0, 2, 5], 100.0, 200.0, 4.0
    inputs = {"stripe": pack(stripe=stripe), "background": manifest.model_dump_json().encode()}
    return unpack(colour.run(inputs, None, {"background": array}))


def test_each_point_has_the_colour_of_its_frame(tmp_path: Path) -> None:
    found = coloured(*ingested(tmp_path, LEVELS))
    assert found["seen"].tolist() == [True, True, False]
    expected = linear_light(np.array([[60.0] * 3, [180.0] * 3, [0.0] * 3]) / 255)
    np.testing.assert_allclose(found["colours"], expected, atol=0.005)


def test_a_single_background_shows_no_skin(tmp_path: Path) -> None:
    found = coloured(*ingested(tmp_path, LEVELS[:1]))
    assert not found["seen"].any()


def test_a_damaged_array_is_ingested_anew_by_the_next_run(tmp_path: Path) -> None:
    array, manifest = ingested(tmp_path, LEVELS)
    put_frame(array, 2, frame_bytes(array, 2)[:-9])
    with pytest.raises(DamagedError, match="frame 2"):
        coloured(array, manifest)
    assert not (array / "zarr.json").exists()
