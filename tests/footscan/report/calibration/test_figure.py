"""The picture of a calibration, read back as pixels."""

import io
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from footscan.report.calibration.facts import round_up
from footscan.report.calibration.figure import calibration_figure
from schemas.calibration import Calibration, CameraCalibration, PolynomialMap

SQUARE = [(100.0, 100.0), (500.0, 100.0), (500.0, 400.0), (100.0, 400.0)]


def camera(number: int, **known: object) -> CameraCalibration:
    plain = PolynomialMap(order=1, centre_px=(0, 0), scale_px=1, alpha_y=[0, 0.3, 0], alpha_z=[0, 0, 0.3])
    return CameraCalibration.model_validate({"camera": number, "map": plain, "region_px": SQUARE, "points": 4} | known)


def drawn(*cameras: CameraCalibration) -> NDArray[np.int16]:
    png = calibration_figure(Calibration(sources=[], software="footscan", cameras=list(cameras)))
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), np.int16)


def reddish(image: NDArray[np.int16]) -> int:
    return int(np.sum(image[..., 0] - image[..., 1:].max(axis=2) > 40))


def test_residuals_are_drawn_in_proportion() -> None:
    none = drawn(camera(1, residuals=[]))
    some = drawn(camera(1, residuals=[(300, 250, 0.1, 0), (200, 250, 0.02, 0.0)]))
    assert reddish(none) == 0
    assert reddish(some) > 10


def test_coverage_is_coloured_by_uncertainty_and_plain_without() -> None:
    plain = drawn(camera(1))
    unsure = drawn(camera(1, covariance=[[1e-4 if i == j else 0.0 for j in range(i + 1)] for i in range(6)]))
    assert np.any(np.all(np.abs(plain - [0xB9, 0xD4, 0xE8]) < 3, axis=2))
    assert not np.array_equal(plain[: len(unsure), : unsure.shape[1]], unsure[: len(plain), : plain.shape[1]])


def test_a_calibration_that_knows_nothing_is_drawn_all_the_same() -> None:
    assert drawn(camera(1, region_px=[]), camera(2, image_px=(100, 80), region_px=[])).shape[2] == 3


def test_nine_cameras_take_three_rows() -> None:
    assert len(drawn(*(camera(k) for k in range(1, 10)))) > 1.3 * len(drawn(*(camera(k) for k in range(1, 6))))


def test_the_same_calibration_gives_the_same_bytes_in_threads() -> None:
    calibration = Calibration(sources=[], software="footscan", cameras=[camera(k) for k in range(1, 4)])
    with ThreadPoolExecutor(4) as pool:
        pictures = list(pool.map(calibration_figure, [calibration] * 8))
    assert len(set(pictures)) == 1


@pytest.mark.parametrize(
    ("value", "up"),
    [(0.0, 0.001), (0.001, 0.001), (0.0011, 0.002), (0.021, 0.05), (0.5, 0.5), (0.51, 1.0), (7.0, 10.0)],
)
def test_round_up(value: float, up: float) -> None:
    assert round_up(value) == pytest.approx(up)
