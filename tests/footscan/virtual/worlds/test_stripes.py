"""Stripe points of worlds without pictures."""

import numpy as np
import pytest

from footscan.virtual.worlds.machine import Machine, machine_of, moved_camera
from footscan.virtual.worlds.stripes import world_stripes
from footscan.virtual.worlds.subject import Subject, make_subject
from schemas.world import World, WorldCameras, WorldGlass, WorldHead, WorldLaser, WorldRoom, WorldSubject

COARSE = WorldCameras(frames=40, step_mm=10.0)


@pytest.fixture(scope="module")
def foot() -> Subject:
    return make_subject(WorldSubject(), 3.0)


def stripes(foot: Subject, **parts: object) -> tuple[Machine, dict[int, np.ndarray]]:
    machine = machine_of(World(seed=3, cameras=COARSE).model_copy(update=parts))
    return machine, world_stripes(machine, foot)


def across_errors(machine: Machine, camera: int, points: np.ndarray) -> np.ndarray:
    """Errors of the pixels, (N, 2) px, from the exact places; all rows are exposed at the frame's time."""
    exact = np.full((len(points), 2), np.nan)
    for frame in np.unique(points["frame"]):
        here = points["frame"] == frame
        pose = machine.pose(machine.head_of[camera], machine.seconds(int(frame)))
        exact[here] = moved_camera(machine.cameras[camera], pose).project(points["place"][here].astype(np.float64))
    return np.column_stack([points["i"], points["j"]]) - exact


def test_pixels_are_those_of_the_places_but_for_the_reported_noise(foot: Subject) -> None:
    machine, found = stripes(foot, room=WorldRoom())
    assert set(found) == set(range(1, 9))
    for camera, points in found.items():
        assert len(points) > 1000
        error = np.linalg.norm(across_errors(machine, camera, points), axis=1)
        assert np.sqrt(np.mean(error**2)) == pytest.approx(np.sqrt(np.mean(points["sigma"] ** 2)), rel=0.3)


def test_places_lie_on_the_subject_in_the_plane_of_the_laser(foot: Subject) -> None:
    machine, found = stripes(foot)
    for camera, points in found.items():
        x = machine.step_mm(machine.head_of[camera]) * points["frame"]
        assert points["place"][:, 0] == pytest.approx(x, abs=1e-3)


def test_cameras_below_see_the_stripes_of_two_planes(foot: Subject) -> None:
    machine, found = stripes(foot, laser=WorldLaser(lower_lasers=2, lower_apart_mm=12.0))
    for camera in (5, 6, 7, 8):
        ahead = found[camera]["place"][:, 0] - machine.step_mm(2) * found[camera]["frame"]
        near = [np.abs(ahead - plane) < 1e-3 for plane in (0.0, 12.0)]
        assert (near[0] | near[1]).all()
        assert min(one.mean() for one in near) > 0.3
    assert min(len(found[camera]) for camera in (1, 2, 3, 4)) > 1000


def test_a_faint_laser_in_a_bright_room_is_not_found(foot: Subject) -> None:
    def count(power: float, light: float) -> int:
        _, found = stripes(foot, laser=WorldLaser(power=power), room=WorldRoom(light=light))
        return sum(len(found[camera]) for camera in (1, 2, 3, 4))

    usual = count(24.0, 0.1)
    assert count(0.1, 3.0) < 0.2 * usual
    assert count(24.0, 3.0) < usual


def test_noise_grows_where_light_is_faint(foot: Subject) -> None:
    _, bright = stripes(foot, laser=WorldLaser(power=24.0))
    _, faint = stripes(foot, laser=WorldLaser(power=1.0))
    assert np.median(faint[1]["sigma"]) > 1.2 * np.median(bright[1]["sigma"])


def test_a_rolling_shutter_moves_later_rows(foot: Subject) -> None:
    cameras = COARSE.model_copy(update={"rolling_shutter_ms": 30.0, "step_mm": 10.0, "frames_per_second": 10.0})
    machine, found = stripes(foot, cameras=cameras)
    points = found[1]
    late_mm = points["place"][:, 0] - machine.step_mm(0) * points["frame"]
    assert np.ptp(points["j"]) > 200.0
    assert late_mm == pytest.approx(3.0 * (points["j"] + 0.5) / 480.0, abs=0.03)  # of 3 mm in the 30 ms of the readout


def test_glints_are_no_places(foot: Subject) -> None:
    _, found = stripes(foot, room=WorldRoom(head_glints=3))
    for points in found.values():
        is_clutter = np.isnan(points["place"][:, 0])
        assert 0 < is_clutter.sum() < len(points)


def test_missing_cameras_give_nothing_and_thick_glass_moves_the_sole(foot: Subject) -> None:
    machine, found = stripes(foot, cameras=COARSE.model_copy(update={"missing": [2, 7]}))
    assert set(found) == {1, 3, 4, 5, 6, 8}
    thick, _ = stripes(foot, glass=WorldGlass(thickness_mm=10.0))
    point = np.array([[0.0, 30.0, 2.0]])
    moved = thick.cameras[5].project(point) - machine.cameras[5].project(point)
    assert np.abs(moved).max() > 2.0
    assert thick.cameras[1].project(point) == pytest.approx(machine.cameras[1].project(point))


def test_a_head_at_another_speed_has_frames_of_its_own(foot: Subject) -> None:
    machine, found = stripes(foot, heads=(WorldHead(), WorldHead(), WorldHead(speed=0.5)))
    assert machine.frames(2) == 2 * machine.frames(0)
    assert found[5]["frame"].max() > found[1]["frame"].max()
