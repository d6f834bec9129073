"""The calibration file: its versions, their migration, and what is refused.

The files in `frozen` are as the program of their time wrote them, with numbers to be worked out by hand. They stay.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from footscan.calibration.models.maps import is_supported, prediction_covariance, to_world
from schemas.base.errors import RefusedInput
from schemas.calibration import Calibration, calibration_from_json, read_calibration

FROZEN = Path(__file__).parent / "frozen"
FILES = sorted(FROZEN.glob("calibration-*.json"))
RANGE = "'footscan.calibration/1' to 'footscan.calibration/4'"


def frozen(name: str) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((FROZEN / f"calibration-{name}.json").read_text())
    return content


def changed(name: str, path: str, value: Any) -> dict[str, Any]:
    """A frozen file with another value at `path`, of the first camera if not told otherwise."""
    content = frozen(name)
    *parents, last = path.split(".")
    part: Any = content
    for parent in parents:
        part = part[int(parent) if isinstance(part, list) else parent]
    part[int(last) if isinstance(part, list) else last] = value
    return content


def refusal(value: Any) -> str:
    with pytest.raises(RefusedInput) as caught:
        calibration_from_json(value if isinstance(value, str) else json.dumps(value), "calibration.json")
    message = str(caught.value)
    assert message.startswith("calibration.json: ")
    assert "\n" not in message
    assert len(message) < 400
    return message.removeprefix("calibration.json: ")


def world_of(calibration: Calibration, camera: int, pixel: tuple[float, float]) -> list[float]:
    return to_world(calibration.camera(camera), np.array([pixel]))[0].tolist()


def test_version_1_in_millimetres() -> None:
    calibration = read_calibration(FROZEN / "calibration-1-mm.json")
    # at (100, 200): 1, 100, 200, 10,000, 20,000, 40,000
    y = 1.5 + 1.0 - 4.0 + 0.3 - 0.8 + 2.0
    z = -0.5 + 0.2 + 6.0 - 0.1 + 0.4 + 2.4
    assert world_of(calibration, 3, (100, 200)) == pytest.approx([y, z], rel=1e-12)
    assert world_of(calibration, 3, (0, 0)) == [1.5, -0.5]


def test_version_1_in_centimetres() -> None:
    calibration = read_calibration(FROZEN / "calibration-1-cm.json")
    # at (300, 200) in cm: 1, 300, 200, 90,000, 60,000, 40,000
    y = -6.0 + 6.0 + 0.9 - 1.2
    z = 3.0 + 1.0 + 0.6 - 0.4
    assert world_of(calibration, 1, (300, 200)) == pytest.approx([10 * y, 10 * z], rel=1e-12)
    assert world_of(calibration, 5, (17, 250)) == pytest.approx([20, 25], rel=1e-12)


def test_what_version_1_does_not_say_is_not_made_up() -> None:
    calibration = read_calibration(FROZEN / "calibration-1-cm.json")
    camera = calibration.camera(1)
    assert (calibration.format, calibration.unit) == ("footscan.calibration/4", "mm")
    assert (calibration.software, calibration.created) == ("footscan.calibration/1", None)
    assert [source.name for source in calibration.sources] == [str(FROZEN / "calibration-1-cm.json")]
    assert (camera.image_px, camera.covariance, camera.region_px, camera.points) == (None, [], [], 0)
    assert (camera.rms_mm, camera.held_out_rms_mm, camera.worst_mm, camera.condition) == (None,) * 4


def test_version_2() -> None:
    calibration = read_calibration(FROZEN / "calibration-2.json")
    # camera 1 at (400, 140): u = 0.5, v = -0.5
    assert world_of(calibration, 1, (400, 140)) == pytest.approx([-0.5 + 10 - 0.75, 40 - 0.125 + 25], rel=1e-12)
    # camera 3 at (520, 125): u = 1, v = -0.5, u^2 = 1, uv = -0.5, v^2 = 0.25
    y = 0.4 + 20.8 - 0.5 - 0.5 - 0.125 + 0.1875
    z = 44.0 + 2.5 + 26.5 + 0.5 + 0.75 + 0.5
    assert world_of(calibration, 3, (520, 125)) == pytest.approx([y, z], rel=1e-12)


def test_what_version_2_says_is_kept() -> None:
    calibration = read_calibration(FROZEN / "calibration-2.json")
    [source] = calibration.sources
    assert (source.name, source.sha256[:8]) == ("chart.csv", "0cff4295")
    assert (calibration.software, calibration.created, calibration.pairs) == ("footscan 0.1.0", None, [])
    first, third = calibration.cameras
    assert (first.points, first.rms_mm, first.held_out_rms_mm) == (6, 0.09300414960547439, 0.1487506231893151)
    assert first.region_px == [(500, 400), (100, 400), (100, 80), (500, 80)]
    assert is_supported(first, np.array([[300, 240], [90, 240]])).tolist() == [True, False]
    assert (third.region_px, third.held_out_rms_mm, third.covariance) == ([], None, [])


def test_version_3() -> None:
    calibration = read_calibration(FROZEN / "calibration-3.json")
    # Camera 1 at (519.5, 39.5): u = 0.5, v = -0.5, r^2 = 0.5, so k1 r^2 + k2 r^4 = -0.01 + 0.001 = -0.009.
    u = 0.5 - 0.0045 + 2 * 0.001 * -0.25 - 0.002 * (0.5 + 0.5)
    v = -0.5 + 0.0045 + 0.001 * (0.5 + 0.5) + 2 * -0.002 * -0.25
    assert (u, v) == pytest.approx((0.493, -0.4935), rel=1e-12)
    # depth 1 + 0.0493 - 0.0987 = 0.9506; the correction adds 0.025 + 0.05 + 0.1 and 0.05 - 0.01
    y = (29.58 - 4.935 + 5.0) / 0.9506 + 0.175
    z = (-2.465 + 39.48 + 45.0) / 0.9506 + 0.04
    assert world_of(calibration, 1, (519.5, 39.5)) == pytest.approx([y, z], rel=1e-12)
    assert world_of(calibration, 1, (319.5, 239.5)) == pytest.approx([5, 45], rel=1e-12)
    assert world_of(calibration, 5, (420, 290)) == pytest.approx([15, 40], rel=1e-12)


def test_what_version_3_says_is_read() -> None:
    calibration = read_calibration(FROZEN / "calibration-3.json")
    assert calibration.created is not None
    assert calibration.created.isoformat() == "2026-11-20T08:30:00+00:00"
    assert [source.name for source in calibration.sources] == ["capture.yaml", "reference.yaml"]
    [pair] = calibration.pairs
    assert (pair.cameras, pair.places, pair.rms_mm, pair.worst_mm) == ((1, 5), 12, 0.08, 0.21)
    # at u = 2 of camera 5: 0.04 + 2 * 2 * 0.005 + 4 * 0.01 = 0.1 and 0.09 + 4 * 0.01 = 0.13
    covariance = prediction_covariance(calibration.camera(5), np.array([[520.0, 240.0]]))
    np.testing.assert_allclose(covariance, [[[0.1, -0.01], [-0.01, 0.13]]], rtol=1e-12)
    assert prediction_covariance(calibration.camera(1), np.array([[520.0, 240.0]])) is None


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_what_was_migrated_is_written_and_read_again(file: Path, tmp_path: Path) -> None:
    calibration = read_calibration(file)
    path = tmp_path / "calibration.json"
    path.write_text(calibration.model_dump_json(indent=2))
    assert json.loads(path.read_text())["format"] == "footscan.calibration/4"
    assert read_calibration(path) == calibration


def test_every_version_is_frozen() -> None:
    assert [file.stem for file in FILES] == [
        "calibration-1-cm", "calibration-1-mm", "calibration-2", "calibration-3", "calibration-4",
    ]  # fmt: skip


@pytest.mark.parametrize("version", ["5", "10", "99", "9" * 300])
def test_a_newer_version_is_refused_by_name(version: str) -> None:
    value = frozen("3") | {"format": f"footscan.calibration/{version}"}
    message = refusal(value)
    assert message.startswith("format: expected version 1 to 4, found 'footscan.calibration/")
    assert message.endswith(": a newer footscan wrote it")


@pytest.mark.parametrize(
    "version",
    ["footscan.calibration/0", "footscan.calibration/03", "footscan.calibration/04", "footscan.calibration/x",
     "footscan.calibration/-1", "footscan.calibration/3.1", "footscan.calibration/²", "footscan.calibration/٤",
     "footscan.calibration/", "footscan.calibration", "footscan.scan/1", " footscan.calibration/3", 3, None, True,
     ["footscan.calibration/3"], {"version": 3}],
)  # fmt: skip
def test_no_version_is_refused(version: Any) -> None:
    assert refusal(frozen("3") | {"format": version}) == f"format: expected {RANGE}, found {version!r}"


def test_a_long_text_for_a_version_is_not_repeated_whole() -> None:
    assert refusal(frozen("3") | {"format": "footscan.calibration/" + "x" * 10_000}).startswith("format: expected")


def test_a_missing_version_is_refused() -> None:
    value = frozen("3")
    del value["format"]
    assert refusal(value) == f"format: expected {RANGE}, found None"


@pytest.mark.parametrize("content", ["", "{", "[]", "3", '"footscan.calibration/3"', "null"])
def test_what_is_no_document_is_refused(content: str) -> None:
    refusal(content)


MATRIX, TRIANGLE = "cameras.0.map.matrix.3", "cameras.1.covariance"


@pytest.mark.parametrize("word", ["NaN", "Infinity", "-Infinity"])
@pytest.mark.parametrize("path", [MATRIX, f"{TRIANGLE}.2.1", "cameras.0.region_px.1.0", "cameras.0.map.distortion.k1"])
def test_what_is_no_number_is_refused(path: str, word: str) -> None:
    text = json.dumps(changed("3", path, "here")).replace('"here"', word)
    assert refusal(text) == f"expected a JSON document ({word} is no JSON number)"


SQUARE = [[0, 0], [9, 0], [9, 9], [0, 9]]


@pytest.mark.parametrize(
    ("path", "value", "expected"),
    [
        ("cameras.0.map.order", 1, "cameras.0.map.homography.order: unknown field"),
        (MATRIX, 1e300, "cameras.0.map.homography.matrix.3: input should be less than or equal to 10000000000000"),
        (MATRIX, -1e300, "cameras.0.map.homography.matrix.3: input should be greater than or equal to -1000000000000"),
        (MATRIX, "NaN", "cameras.0.map.homography.matrix.3: input should be a finite number, found 'NaN'"),
        (MATRIX, None, "cameras.0.map.homography.matrix.3: input should be a valid number, found 'None'"),
        ("cameras.0.map.matrix", [1.0] * 9, "cameras.0.map.homography.matrix: list should have at most 8 items"),
        ("cameras.0.map.matrix", [1.0] * 7, "cameras.0.map.homography.matrix: list should have at least 8 items"),
        ("cameras.0.map.scale_px", 0, "cameras.0.map.homography.scale_px: input should be greater than"),
        ("cameras.0.map.scale_px", 1e-300, "cameras.0.map.homography.scale_px: input should be greater than"),
        ("cameras.0.map.centre_px", [1e300, 0], "cameras.0.map.homography.centre_px.0: input should be less than"),
        ("cameras.0.map.distortion", {"k1": 1}, "cameras.0.map.homography.distortion.k2: is missing"),
        (
            "cameras.0.map.correction.order",
            6,
            "cameras.0.map.homography.correction.order: input should be less than or",
        ),
        ("cameras.0.map.correction.order", 3, "cameras.0.map.homography.correction: order 3 has 7 terms, expected as"),
        ("cameras.0.map.model", "spline", "cameras.0.map: input tag 'spline' found using 'model' does not match any"),
        ("cameras.0.map", {}, "cameras.0.map: unable to extract tag using discriminator 'model'"),
        (
            "cameras.1.map.order",
            6,
            "cameras.1.map.polynomial.order: input should be less than or equal to 5, found '6'",
        ),
        ("cameras.1.map.order", 2, "cameras.1.map.polynomial: order 2 has 6 terms, expected as many in alpha_y and"),
        ("cameras.1.map.alpha_z", [1, 2], "cameras.1.map.polynomial: order 1 has 3 terms"),
        (TRIANGLE, [[1.0]], "cameras.1: covariance: expected the lower triangle of 6 x 6 numbers, row by row"),
        (TRIANGLE, [[0.0] * 6] * 6, "cameras.1: covariance: expected the lower triangle of 6 x 6 numbers, row by row"),
        (TRIANGLE, [[1.0]] * 100_000, "cameras.1: covariance: expected the lower triangle of 6 x 6 numbers"),
        (TRIANGLE, 4, "cameras.1.covariance: input should be a valid list, found '4'"),
        ("cameras.0.region_px", [[1, 2]] * 200_000, "cameras.0.region_px: list should have at most 10000 items"),
        ("cameras.0.region_px", SQUARE[:2], "cameras.0: region_px: expected the corners of a convex region"),
        ("cameras.0.region_px", [[1, 1]] * 4, "cameras.0: region_px: expected the corners of a convex region"),
        ("cameras.0.region_px", [*SQUARE, [5, 5]], "cameras.0: region_px: expected the corners of a convex region"),
        ("cameras.0.region_px", [[0, 0], [9, 9], [9, 0], [0, 9]], "cameras.0: region_px: expected the corners of a"),
        ("cameras.0.region_px", [[1e308, 0], [0, 1e308], [-1e308, 0]], "cameras.0.region_px.0.0: input should be less"),
        ("cameras.0.image_px", [640, 0], "cameras.0.image_px.1: input should be greater than or equal to 1, found '0'"),
        ("cameras.0.points", -1, "cameras.0.points: input should be greater than or equal to 0, found '-1'"),
        ("cameras.1.camera", 1, "expected each camera once for each of its lasers, found 1, 1"),
        ("cameras", [], "cameras: list should have at least 1 item"),
        ("created", "2026-11-20T08:30:00", "created: input should have timezone info"),
        ("created", "yesterday", "created: input should be a valid datetime"),
        ("unit", "cm", "unit: input should be 'mm', found 'cm'"),
        ("pair", [], "pair: unknown field, did you mean 'pairs'?"),
    ],
)
def test_hostile_version_3_is_refused(path: str, value: Any, expected: str) -> None:
    assert refusal(changed("3", path, value)).startswith(expected)


@pytest.mark.parametrize("region", [SQUARE, SQUARE[::-1], [*SQUARE, [0, 0]], [[0, 0], [5, 0], [9, 0], [9, 9]]])
def test_convex_regions_are_accepted(region: list[list[float]]) -> None:
    camera = calibration_from_json(json.dumps(changed("3", "cameras.0.region_px", region)), "x").camera(1)
    assert is_supported(camera, np.array([[6.0, 3.0], [-1.0, -1.0]])).tolist() == [True, False]


@pytest.mark.parametrize(
    ("path", "value", "expected"),
    [
        ("cameras.0.order", 2, "cameras.0: order 2 has 6 terms, expected as many in alpha_y and alpha_z"),
        ("cameras.0.order", 6, "cameras.0.order: input should be less than or equal to 5, found '6'"),
        ("cameras.0.alpha_z", [1, 2], "cameras.0: order 1 has 3 terms"),
        ("cameras.0.alpha_y", [0, 1, None], "cameras.0.alpha_y.2: input should be a valid number, found 'None'"),
        ("cameras.0.alpha_y", [0, 1, 1e300], "cameras.0.map.polynomial.alpha_y.2: input should be less than or equal"),
        ("cameras.0.scale_px", 0, "cameras.0.scale_px: input should be greater than 0"),
        ("cameras.1.camera", 1, "expected each camera once, found [1, 1]"),
        ("cameras", [], "cameras: list should have at least 1 item"),
        ("map", {}, "map: unknown field"),
    ],
)
def test_broken_version_2_is_refused(path: str, value: Any, expected: str) -> None:
    assert refusal(changed("2", path, value)).startswith(expected)


@pytest.mark.parametrize(
    ("path", "value", "expected"),
    [
        ("unit", "inch", "unit: input should be 'cm' or 'mm', found 'inch'"),
        ("cameras.0.alpha_y", [1, 2, 3, 4, 5], "cameras.0.alpha_y: list should have at least 6 items"),
        ("cameras.0.alpha_y", [1e308] * 6, "cameras.0.alpha_y.0: input should be a finite number"),
        ("cameras.1.camera", 1, "expected each camera once, found [1, 1]"),
        ("cameras.1.camera", 0, "cameras.1.camera: input should be greater than or equal to 1"),
    ],
)
def test_broken_version_1_is_refused(path: str, value: Any, expected: str) -> None:
    assert refusal(changed("1-cm", path, value)).startswith(expected)


def test_missing_camera_is_refused_with_those_there_are() -> None:
    calibration = read_calibration(FROZEN / "calibration-3.json")
    with pytest.raises(RefusedInput, match=r"^c\.json: cameras: has no camera 7, expected one of 1, 5$"):
        calibration.camera(7, "c.json")


def test_version_3_does_not_say_where_the_laser_planes_lie() -> None:
    assert all(camera.plane is None for camera in read_calibration(FROZEN / "calibration-3.json").cameras)
    planes = [camera.plane for camera in read_calibration(FROZEN / "calibration-4.json").cameras]
    assert [plane.head for plane in planes if plane is not None] == [1, 1]


def test_a_camera_may_have_a_map_for_each_of_two_lasers() -> None:
    content = frozen("4")
    first = content["cameras"][0]
    content["cameras"] = [first, {**first, "laser": 2, "ahead_mm": 12.0}]
    calibration = calibration_from_json(json.dumps(content), "calibration.json")
    number = first["camera"]
    assert [camera.view for camera in calibration.maps(number)] == [number, number + 64]
    assert calibration.camera(number).laser == 1
    written = json.loads(calibration.model_dump_json())["cameras"]
    assert [(camera.get("laser"), camera.get("ahead_mm")) for camera in written] == [(None, None), (2, 12.0)]
    content["cameras"] = [first, {**first, "laser": 3}]
    assert "cameras.1.laser: " in refusal(content)
    content["cameras"] = [first, {**first, "laser": 2}, {**first, "laser": 2}]
    assert refusal(content).startswith("expected each camera once for each of its lasers")
