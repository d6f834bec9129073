"""A thumbnail, read back as pixels: to one scale for all feet, the toes to the right."""

import io

import numpy as np
import pytest
import trimesh
from PIL import Image

from footscan.report.thumbnail import HEIGHT_PX, WIDTH_PX, thumbnail


@pytest.mark.parametrize(
    ("length", "wide_px", "high_px"),
    [
        (160.0, WIDTH_PX / 2, 30.0),  # 320 mm fill the width: 0.6 px a mm
        (640.0, WIDTH_PX, 15.0),  # longer ones are drawn smaller
    ],
)
def test_a_box_is_as_large_as_the_scale_says(length: float, wide_px: float, high_px: float) -> None:
    box = trimesh.creation.box(extents=(length, 50, 30))
    png = thumbnail(np.asarray(box.vertices), np.asarray(box.faces), np.eye(4).tolist())
    alpha = np.asarray(Image.open(io.BytesIO(png)))[..., 3]
    assert alpha.shape == (HEIGHT_PX, WIDTH_PX)
    assert np.ptp(np.flatnonzero(alpha.any(axis=0))) + 1 == pytest.approx(wide_px, abs=1)
    assert np.ptp(np.flatnonzero(alpha.any(axis=1))) + 1 == pytest.approx(high_px, abs=1)
    middle = np.argwhere(alpha).mean(axis=0)
    np.testing.assert_allclose(middle, [(HEIGHT_PX - 1) / 2, (WIDTH_PX - 1) / 2], atol=1)
