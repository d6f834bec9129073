"""Where heads, lasers and cameras are at each moment."""

import numpy as np
import pytest

from footscan.virtual.optics.scanner import standard_scanner
from footscan.virtual.worlds.draw import draw_world
from footscan.virtual.worlds.machine import HEAD_CENTRE, Exposure, machine_of, moved_camera, when_calibrated
from schemas.world import Knock, World, WorldCameras, WorldGlass, WorldHead, WorldLaser, WorldSubject

NOMINAL = World(seed=5)


def with_head(**errors: float) -> World:
    return NOMINAL.model_copy(update={"heads": (WorldHead(**errors), WorldHead(), WorldHead())})


def test_a_nominal_head_is_where_it_reports() -> None:
    machine = machine_of(NOMINAL)
    seconds = machine.seconds(25)
    for head in range(3):
        pose = machine.pose(head, seconds)
        assert pose.turn == pytest.approx(np.eye(3))
        assert pose.shift == pytest.approx([machine.reported_x(head, seconds), 0.0, 0.0])
    assert machine.reported_x(0, seconds) == pytest.approx(100.0)


@pytest.mark.parametrize("world", [draw_world(seed) for seed in range(6)])
def test_poses_are_rigid_and_can_be_undone(world: World) -> None:
    machine = machine_of(world)
    points = np.random.default_rng(1).normal(0.0, 60.0, (50, 3))
    for head in range(3):
        pose = machine.pose(head, machine.seconds(17.3))
        assert pose.turn @ pose.turn.T == pytest.approx(np.eye(3), abs=1e-12)
        assert pose.undo(pose.apply(points)) == pytest.approx(points)
        still = Exposure(0.0, pose, np.zeros(3))
        assert machine.sheet_distance(pose.apply(points), still, np.zeros(50)) == pytest.approx(
            points[:, 0] - world.laser.bend_mm * (points[:, 1] / 70.0) ** 2
        )


def test_errors_of_a_head_do_what_they_say() -> None:
    def x(world: World, seconds: float) -> float:
        return float(machine_of(world).pose(0, seconds).apply(HEAD_CENTRE[None])[0, 0])

    seconds = machine_of(NOMINAL).seconds(50)
    assert x(NOMINAL, seconds) == pytest.approx(200.0)
    assert x(with_head(offset_mm=2.0), seconds) == pytest.approx(202.0)
    assert x(with_head(travel_scale=0.005), seconds) == pytest.approx(201.0)
    assert x(with_head(lost_mm=1.5, lost_at=0.4), seconds) == pytest.approx(198.5)
    assert x(with_head(lost_mm=1.5, lost_at=0.6), seconds) == pytest.approx(200.0)
    assert x(with_head(yaw_deg=1.0), seconds) == pytest.approx(200.0)


def test_a_yaw_moves_the_sheet_with_y() -> None:
    machine = machine_of(with_head(yaw_deg=1.0))
    pose = machine.pose(0, 0.0)
    on_sheet = pose.apply(np.array([[0.0, 70.0, 57.0], [0.0, -70.0, 57.0]]))
    assert on_sheet[:, 0] == pytest.approx([-70.0 * np.sin(np.radians(1.0)), 70.0 * np.sin(np.radians(1.0))])


def test_the_plate_moves_what_stands_on_it() -> None:
    machine = machine_of(NOMINAL.model_copy(update={"glass": WorldGlass(height_mm=1.2, tilt_x_deg=0.5)}))
    point = np.array([[200.0, 40.0, 0.0]])
    in_scanner = machine.plate.apply(point)[0]
    assert in_scanner == pytest.approx([200.0, 40.0 * np.cos(np.radians(0.5)), 1.2 + 40.0 * np.sin(np.radians(0.5))])


def test_a_subject_that_moved_before_the_lower_pass() -> None:
    machine = machine_of(NOMINAL.model_copy(update={"subject": WorldSubject(shift_mm=(1.0, -0.5))}))
    assert machine.pose(0, 0.0).shift == pytest.approx([0.0, 0.0, 0.0])
    assert machine.pose(2, 0.0).shift == pytest.approx([-1.0, 0.5, 0.0])
    assert [machine.pass_number(head) for head in range(3)] == [1, 1, 2]


def test_a_subject_moves_on_while_the_lower_pass_is_waited_for() -> None:
    swaying = WorldSubject(sway_mm=0.3)
    together, later = (
        machine_of(NOMINAL.model_copy(update={"subject": subject}))
        for subject in (swaying, swaying.model_copy(update={"wait_s": 20.0}))
    )
    assert [together.pass_number(head) for head in range(3)] == [1, 1, 1]
    np.testing.assert_array_equal(later.pose(0, 1.0).shift, together.pose(0, 1.0).shift)
    seen = later.pose(2, 1.0).shift - [later.reported_x(2, 1.0), 0.0, 0.0]
    assert seen == pytest.approx(together.pose(2, 21.0).shift - [together.reported_x(2, 21.0), 0.0, 0.0])
    # In a pass, the lasers of all heads shine on the foot where it is then.
    lower, upper = later.sheet(2, 1.0, pass_number=2), later.sheet(0, 1.0, pass_number=2)
    assert lower.pose.shift[1] == pytest.approx(upper.pose.shift[1])


def test_a_knock_comes_after_the_calibration() -> None:
    knock = Knock(camera=3, mm=(0.5, 0.0, 0.0), turn_deg=(0.0, 0.0, 0.1))
    machine = machine_of(NOMINAL.model_copy(update={"cameras": WorldCameras(knocked=[knock], missing=[1])}))
    standard = standard_scanner(5).camera(3)
    assert set(machine.cameras) == {2, 3, 4, 5, 6, 7, 8}
    assert machine.calibrated[3].position == pytest.approx(standard.position)
    assert machine.cameras[3].position == pytest.approx(standard.position + np.array([0.5, 0.0, 0.0]))
    assert machine.cameras[4].position == pytest.approx(machine.calibrated[4].position)


def test_a_moved_camera_sees_moved_points_at_the_same_pixels() -> None:
    machine = machine_of(NOMINAL)
    pose = machine.pose(0, machine.seconds(30))
    points = np.array([[0.0, 20.0, 40.0], [3.0, -10.0, 60.0]])
    camera = machine.cameras[1]
    assert moved_camera(camera, pose).project(pose.apply(points)) == pytest.approx(camera.project(points))


def test_a_wide_picture_has_the_same_view() -> None:
    wide = machine_of(NOMINAL.model_copy(update={"cameras": WorldCameras(size="1280x720")}))
    usual = machine_of(NOMINAL)
    points = np.array([[0.0, 20.0, 40.0]])
    i, j = usual.cameras[1].project(points)[0]
    assert wide.cameras[1].project(points)[0] == pytest.approx([2.0 * i + 0.5, 2.0 * (j - 239.5) + 359.5])


def test_two_lower_lasers_shine_at_the_same_place() -> None:
    machine = machine_of(NOMINAL.model_copy(update={"laser": WorldLaser(lower_lasers=2)}))
    one, other = machine.sheets[2].lasers
    assert one.position[1] == -other.position[1] == 70.0
    for laser in (one, other):
        position, axis = np.array(laser.position), np.array(laser.axis)
        assert position - axis * position[2] / axis[2] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def test_a_scanner_that_is_calibrated_has_not_been_knocked_and_shows_one_laser() -> None:
    world = next(world for world in map(draw_world, range(99)) if world.cameras.knocked and world.glass.height_mm)
    now, then = machine_of(world), when_calibrated(machine_of(world))
    knocked = world.cameras.knocked[0].camera
    if knocked in now.cameras:
        assert not np.array_equal(now.cameras[knocked].position, then.cameras[knocked].position)
    assert then.sheets_near(1, 2.0) == [1]
    assert then.plate.shift == pytest.approx(np.zeros(3))
