"""The calibration file: its versions, their migration, and what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from footscan.calibration.polynomial import evaluate
from schemas.calibration import Calibration, CalibrationV1, calibration_from_json, migrate_v1, read_calibration
from schemas.errors import RefusedInput

ALPHA_Y = [1.5, 0.01, -0.02, 3e-5, -4e-5, 5e-5]
ALPHA_Z = [-0.5, 0.002, 0.03, -1e-5, 2e-5, 6e-5]


def version_1(unit: str = "mm", **changes: Any) -> dict[str, Any]:
    camera = {"camera": 3, "alpha_y": ALPHA_Y, "alpha_z": ALPHA_Z} | changes
    return {"format": "footscan.calibration/1", "unit": unit, "cameras": [camera]}


def version_2(**changes: Any) -> dict[str, Any]:
    camera = {
        "camera": 1, "order": 1, "centre_px": [320, 240], "scale_px": 200, "alpha_y": [0, 1, 2], "alpha_z": [3, 4, 5],
        "region_px": [[0, 0], [639, 0], [0, 479]], "points": 12, "rms_mm": 0.1,
    } | changes  # fmt: skip
    return {
        "format": "footscan.calibration/2", "unit": "mm", "source": "chart.csv", "source_sha256": "", "software": "x",
        "cameras": [camera],
    }  # fmt: skip


def refusal(value: Any) -> str:
    with pytest.raises(RefusedInput) as caught:
        calibration_from_json(json.dumps(value), "calibration.json")
    assert str(caught.value).startswith("calibration.json: ")
    return str(caught.value).removeprefix("calibration.json: ")


@pytest.mark.parametrize(("unit", "millimetres"), [("cm", 10.0), ("mm", 1.0)])
def test_version_1_gives_the_same_y_and_z(unit: str, millimetres: float) -> None:
    calibration = calibration_from_json(json.dumps(version_1(unit)), "old.json")
    pixels = np.array([[0.0, 0.0], [320.5, 240.25], [639.0, 479.0], [17.0, 401.5]])
    for (i, j), (y, z) in zip(pixels, evaluate(calibration.camera(3), pixels), strict=True):
        terms = [1.0, i, j, i * i, i * j, j * j]
        assert y == pytest.approx(millimetres * sum(a * t for a, t in zip(ALPHA_Y, terms, strict=True)), rel=1e-12)
        assert z == pytest.approx(millimetres * sum(a * t for a, t in zip(ALPHA_Z, terms, strict=True)), rel=1e-12)
    assert (calibration.format, calibration.unit) == ("footscan.calibration/2", "mm")


def test_current_version_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "calibration.json"
    migrated = migrate_v1(CalibrationV1.model_validate(version_1("cm")), "old.json")
    for calibration in (Calibration.model_validate(version_2()), migrated):
        path.write_text(calibration.model_dump_json(indent=2))
        assert read_calibration(path) == calibration


@pytest.mark.parametrize("version", ["footscan.calibration/3", "footscan.scan/1", None, 2, ["footscan.calibration/2"]])
def test_unknown_version_is_refused_by_name(version: Any) -> None:
    assert refusal(version_2() | {"format": version}) == (
        f"format: expected 'footscan.calibration/1' or 'footscan.calibration/2', found {version!r}"
    )


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ([version_2()], "format: expected 'footscan.calibration/1' or 'footscan.calibration/2', found None"),
        (version_2(order=2), "cameras.0: order 2 has 6 terms, expected as many in alpha_y and alpha_z"),
        (version_2(alpha_z=[1, 2]), "cameras.0: order 1 has 3 terms"),
        (version_2(scale_px=0), "cameras.0.scale_px: input should be greater than 0"),
        (version_2(alpha_y=[0, 1, None]), "cameras.0.alpha_y.2: input should be a valid number, found 'None'"),
        (version_2() | {"cameras": []}, "cameras: list should have at least 1 item"),
        (version_2() | {"cameras": version_2()["cameras"] * 2}, "expected each camera once, found [1, 1]"),
        (version_1() | {"cameras": version_1()["cameras"] * 2}, "expected each camera once, found [3, 3]"),
        (version_1(alpha_y=[1, 2, 3, 4, 5]), "cameras.0.alpha_y: list should have at least 6 items"),
        (version_1("inch"), "unit: input should be 'cm' or 'mm', found 'inch'"),
        (version_1("cm", alpha_y=[1e308] * 6), "cameras.0.alpha_y.0: input should be a finite number"),
    ],
)
def test_broken_calibration_is_refused(value: Any, expected: str) -> None:
    assert refusal(value).startswith(expected)


def test_missing_camera_is_refused_with_those_there_are() -> None:
    calibration = Calibration.model_validate(version_2())
    with pytest.raises(RefusedInput, match=r"^c\.json: cameras: has no camera 7, expected one of 1$"):
        calibration.camera(7, "c.json")
