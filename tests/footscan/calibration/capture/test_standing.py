"""Placements of a cross that are wrong in a known way, as one pinhole sees them."""

from typing import Any

import numpy as np
import pytest
from filmed_cross import CROSS, PLACEMENTS, UPPER_LEFT, filmed
from numpy.typing import NDArray

from footscan.calibration.capture.from_capture import CameraView
from footscan.calibration.capture.reference import Edges, edges_of
from footscan.calibration.capture.standing import judge_standing, moved_px, points_on_object
from schemas.calibration import Calibration, CameraCalibration, HomographyMap

Floats = NDArray[np.float64]
TOLERANCE_MM = 1.0


@pytest.fixture
def edges() -> Edges:
    return edges_of(CROSS)


@pytest.fixture
def camera(pinhole: Any) -> Any:
    return pinhole(target_mm=(10.0, 60.0))


def views_of(stripes: list[Floats]) -> dict[int, CameraView]:
    return {1: CameraView(1, (640, 480), stripes, UPPER_LEFT)}


def test_good_placements_are_not_complained_of(camera: Any, edges: Edges) -> None:
    stripes = filmed(camera, PLACEMENTS)
    for count in (1, 2, 3):
        assert judge_standing(views_of(stripes[:count]), edges, PLACEMENTS[:count], TOLERANCE_MM).complaints == []


def test_an_object_that_stands_elsewhere_is_told_with_the_way_back(camera: Any, edges: Edges) -> None:
    stood = PLACEMENTS.copy()
    stood[2] += (6.0, -4.0)
    [complaint] = judge_standing(views_of(filmed(camera, stood)), edges, PLACEMENTS, TOLERANCE_MM).complaints
    assert complaint.kind == "elsewhere"
    assert complaint.words == (
        "the object stands 6.0 mm too far towards +Y and 4.0 mm too low: "
        "move it 6.0 mm towards -Y and move it 4.0 mm up"
    )


def test_an_object_that_was_not_moved_is_told(camera: Any, edges: Edges) -> None:
    stripes = filmed(camera, PLACEMENTS[[0, 1, 1]])
    stripes[2] = stripes[1]
    [complaint] = judge_standing(views_of(stripes), edges, PLACEMENTS, TOLERANCE_MM).complaints
    assert complaint.words.startswith("the object stands 50.0 mm too far towards +Y and 10.0 mm too low")


def test_two_equal_frames_for_two_placements_are_no_crash(camera: Any, edges: Edges) -> None:
    stripe = filmed(camera, PLACEMENTS[:1])[0]
    complaints = judge_standing(views_of([stripe, stripe]), edges, PLACEMENTS[:2], TOLERANCE_MM).complaints
    assert [complaint.kind for complaint in complaints] in (["elsewhere"], ["not recognised"])


def test_a_dark_frame_and_another_object_are_told(camera: Any, edges: Edges) -> None:
    stripes = filmed(camera, PLACEMENTS[:2])
    dark, circle = np.empty((0, 2)), np.linspace(0, 2 * np.pi, 400)[:, None]
    [complaint] = judge_standing(views_of([stripes[0], dark]), edges, PLACEMENTS[:2], TOLERANCE_MM).complaints
    assert (complaint.kind, complaint.cameras) == ("no stripe", (1,))
    ball = np.column_stack([320 + 90 * np.cos(circle), 240 + 90 * np.sin(circle)])
    [complaint] = judge_standing(views_of([stripes[0], ball]), edges, PLACEMENTS[:2], TOLERANCE_MM).complaints
    assert complaint.kind == "not recognised"


def test_the_first_placement_is_judged_by_an_earlier_calibration(camera: Any, edges: Edges) -> None:
    matrix = camera.to_plane()
    matrix = (matrix / matrix[2, 2]).ravel()[:8].tolist()
    known = CameraCalibration(
        camera=1, map=HomographyMap(centre_px=(0.0, 0.0), scale_px=1.0, matrix=matrix), region_px=[], points=100
    )
    calibration = Calibration(sources=[], software="test", cameras=[known])
    for away_mm, expected in ((2.0, 0), (7.0, 1)):
        views = views_of(filmed(camera, PLACEMENTS[:1] + np.array([away_mm, 0.0])))
        complaints = judge_standing(views, edges, PLACEMENTS[:1], TOLERANCE_MM, calibration).complaints
        assert len(complaints) == expected
    assert complaints[0].words == (
        "the object stands 7.0 mm too far towards +Y: move it 7.0 mm towards -Y, by the scanner's present calibration"
    )


@pytest.mark.parametrize(("way", "expected"), [((0.0, 0.0), 0.0), ((1.5, 0.0), 1.0), ((0.0, 1.5), 1.2)])
def test_a_stripe_that_moved_is_measured(camera: Any, way: tuple[float, float], expected: float) -> None:
    before = filmed(camera, PLACEMENTS[:1], seed=1)[0]
    after = filmed(camera, PLACEMENTS[:1], seed=2)[0] + way
    assert moved_px(before, after) == pytest.approx(expected, abs=0.25)


def test_a_reflection_that_comes_and_goes_is_no_motion_and_no_part_of_the_object(camera: Any, edges: Edges) -> None:
    stripe, again = (filmed(camera, PLACEMENTS[:1], seed=seed)[0] for seed in (1, 2))
    reflection = np.column_stack([np.linspace(100.0, 300.0, 200), np.linspace(400.0, 440.0, 200)])
    both = np.concatenate([stripe, reflection])
    assert moved_px(both, again) < 0.25
    assert moved_px(again, both) < 0.25
    assert moved_px(stripe, stripe + 30.0) == 8.0
    [lies] = points_on_object(views_of([both])[1], edges, PLACEMENTS[:1])
    assert lies[: len(stripe)].mean() > 0.95
    assert lies[len(stripe) :].mean() < 0.1
