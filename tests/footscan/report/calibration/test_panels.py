"""Panels of a calibration: support, residuals and their legend."""

import base64
import io
import re
from typing import Any

import numpy as np
from PIL import Image

from footscan.report.calibration.panels import calibration_panels
from schemas.calibration import Calibration, CameraCalibration, PolynomialMap

SQUARE = [(100.0, 100.0), (500.0, 100.0), (500.0, 400.0), (100.0, 400.0)]
SURE = [[1e-4 if i == j else 0.0 for j in range(i + 1)] for i in range(6)]


def panels(**known: Any) -> str:
    plain = PolynomialMap(order=1, centre_px=(0, 0), scale_px=1, alpha_y=[0, 0.5, 0], alpha_z=[0, 0, 0.5])
    camera = CameraCalibration.model_validate({"camera": 3, "map": plain, "region_px": SQUARE, "points": 4} | known)
    return calibration_panels(Calibration(sources=[], software="footscan", cameras=[camera]))


def test_a_residual_is_an_arrow_from_its_point_30_px_for_the_unit() -> None:
    page = panels(residuals=[(300, 250, 0.1, 0.0)], rms_mm=0.1)
    # 0.1 mm in +Y is towards +i, and 0.1 mm is the unit.
    assert 'd="M300.0 250.0h0M300.0 250.0L330.0 250.0"' in page
    assert "30 px long for 0.1 mm" in page
    assert "rms 0.100 mm" in page


def test_the_region_is_coloured_where_the_map_knows_how_sure_it_is() -> None:
    plain, sure = panels(), panels(covariance=SURE)
    assert 'class="support" points="100.0,100.0 500.0,100.0' in plain
    assert "data:image/png" not in plain
    picture = base64.b64decode(re.findall(r"image/png;base64,([^\"]+)", sure)[0])
    alpha = np.asarray(Image.open(io.BytesIO(picture)))[..., 3]
    assert alpha.shape == (48, 64)  # a place every 10 px
    inside = np.zeros(alpha.shape, bool)
    inside[11:40, 11:50] = True
    assert (alpha[inside] == 255).all()
    assert not alpha[:9].any()
    assert not alpha[:, 52:].any()


def test_a_calibration_that_knows_nothing_is_drawn_all_the_same() -> None:
    assert "4 points" in panels(region_px=[])
