"""Views of a cross by pinholes worked out from where they stand: which edge is which, and where the object stood."""

from typing import Any

import numpy as np
import pytest
from filmed_cross import CROSS, PLACEMENTS, UPPER_LEFT, filmed, seen_at
from numpy.typing import NDArray

from footscan.calibration.capture.placement import CameraFit, agreed_poses, departure, fit_to_edges, joined_poses
from footscan.calibration.capture.recognition import FirstMap, UnrecognisedError, recognise
from footscan.calibration.capture.reference import Edges, edges_of
from footscan.calibration.models.homography import HomographyModel
from schemas.mounting import Mounting

Floats = NDArray[np.float64]
GRID = np.stack(np.meshgrid(np.linspace(-40, 50, 10), np.linspace(30, 100, 8)), -1).reshape(-1, 2)
LENS = HomographyModel((319.5, 239.5), 400.0, True)


@pytest.fixture
def edges() -> Edges:
    return edges_of(CROSS)


def farthest(found: FirstMap | CameraFit, camera: Any) -> float:
    return float(np.linalg.norm(found.world(seen_at(camera, GRID)) - GRID, axis=1).max())


def poses_of(placements: Floats) -> Floats:
    return np.column_stack([placements, np.zeros(len(placements))])


@pytest.mark.parametrize("roll", [0.0, 100.0, 215.0])
@pytest.mark.parametrize("placements", [PLACEMENTS, PLACEMENTS[:1]], ids=["three", "one"])
def test_a_view_is_recognised_whatever_the_roll(pinhole: Any, edges: Edges, roll: float, placements: Floats) -> None:
    camera = pinhole(roll_deg=roll, target_mm=(10.0, 60.0))
    found = recognise(filmed(camera, placements), edges, placements, UPPER_LEFT)
    assert found.score > 0.98
    assert farthest(found, camera) < 2.0  # a view from another side is 60 mm off


def test_placements_outvote_the_mounting(pinhole: Any, edges: Edges) -> None:
    camera = pinhole(target_mm=(10.0, 60.0))
    found = recognise(filmed(camera, PLACEMENTS), edges, PLACEMENTS, Mounting(-1, -1, -1))
    assert farthest(found, camera) < 0.5


def test_a_symmetric_object_in_one_placement_needs_the_mounting(pinhole: Any, edges: Edges) -> None:
    camera = pinhole(target_mm=(10.0, 60.0))
    stripes = filmed(camera, PLACEMENTS[:1])
    with pytest.raises(UnrecognisedError, match="state where the camera stands"):
        recognise(stripes, edges, PLACEMENTS[:1], Mounting(0, 0, 0))
    mirrored = recognise(stripes, edges, PLACEMENTS[:1], Mounting(-1, -1, 1))
    expected = GRID * [-1, 1]  # the cross is its own mirror image, so the mirrored camera sees the same
    assert np.abs(mirrored.world(seen_at(camera, GRID)) - expected).max() < 0.5


def test_glints_gaps_and_a_missing_edge(pinhole: Any, edges: Edges) -> None:
    camera = pinhole(target_mm=(10.0, 60.0))
    random = np.random.default_rng(3)
    stripes = []
    for number, stripe in enumerate(filmed(camera, PLACEMENTS)):
        world = camera.world(stripe) - PLACEMENTS[number]
        kept = (np.abs(world[:, 1] - 55) > 6) & ((world[:, 1] < 99) | (number != 1))  # a gap; the top edge once
        blot = random.normal((500.0, 400.0), 3.0, (40, 2))
        streak = np.column_stack([np.linspace(20, 90, 60), np.linspace(440, 460, 60)])
        stripes.append(np.concatenate([stripe[kept], blot, streak]))
    found = recognise(stripes, edges, PLACEMENTS, UPPER_LEFT)
    fitted = fit_to_edges(stripes, found.world, edges, poses_of(PLACEMENTS), LENS)
    assert farthest(fitted, camera) < 0.1


@pytest.mark.parametrize("count", [0, 3, 200])
def test_no_object(edges: Edges, count: int) -> None:
    stripes = [np.random.default_rng(k).uniform(0, 480, (count, 2)) for k in range(3)]
    with pytest.raises(UnrecognisedError):
        recognise(stripes, edges, PLACEMENTS, UPPER_LEFT)


def test_the_order_of_points_does_not_matter(pinhole: Any, edges: Edges) -> None:
    stripes = filmed(pinhole(target_mm=(10.0, 60.0)), PLACEMENTS)
    found = recognise(stripes, edges, PLACEMENTS, UPPER_LEFT)
    again = recognise([stripe[::-1] for stripe in stripes], edges, PLACEMENTS, UPPER_LEFT)
    assert np.array_equal(found.matrix, again.matrix)


def test_a_departure_is_found_near_and_far(pinhole: Any, edges: Edges) -> None:
    camera = pinhole(target_mm=(10.0, 60.0))
    for offset in ([0.4, -0.2], [22.0, 13.0]):
        stripe = filmed(camera, np.array([offset]))[0]
        found = departure([camera.world(stripe)], edges, np.zeros(3))
        assert found.pose == pytest.approx([*offset, 0.0], abs=0.05)
        assert found.share > 0.9


def test_cameras_agree_on_where_the_object_stood(pinhole: Any, edges: Edges) -> None:
    """Placed by hand, a fifth of a millimetre off: what each camera's map would bend to, all of them together tell."""
    off = np.array([(0.0, 0.0), (0.2, -0.1), (-0.15, 0.1)])
    cameras = {k: pinhole(bearing_deg=30.0 + 12 * k, roll_deg=20.0 * k, target_mm=(10.0, 60.0)) for k in range(3)}
    nominal = poses_of(PLACEMENTS)
    stripes = {k: filmed(camera, PLACEMENTS + off, seed=k) for k, camera in cameras.items()}
    fits = {k: fit_to_edges(stripes[k], cameras[k].world, edges, nominal, LENS) for k in cameras}
    poses, before, after = joined_poses(fits, edges, nominal)
    assert after < 0.5 * before
    found = poses[:, :2] - PLACEMENTS
    assert found - found[0] == pytest.approx(off - off[0], abs=0.06)
    again = {k: fit_to_edges(stripes[k], cameras[k].world, edges, poses, LENS) for k in cameras}
    for k, camera in cameras.items():
        assert farthest(again[k], camera) < 0.6 * farthest(fits[k], camera)


def test_exact_poses_are_kept(pinhole: Any, edges: Edges) -> None:
    cameras = {k: pinhole(bearing_deg=30.0 + 12 * k, target_mm=(10.0, 60.0)) for k in range(2)}
    nominal = poses_of(PLACEMENTS)
    fits = {
        k: fit_to_edges(filmed(camera, PLACEMENTS, seed=k), camera.world, edges, nominal, LENS)
        for k, camera in cameras.items()
    }
    assert np.array_equal(joined_poses(fits, edges, nominal)[0], nominal)
    assert agreed_poses(fits, nominal) == pytest.approx(nominal, abs=0.03)
