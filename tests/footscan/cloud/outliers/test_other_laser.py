from dataclasses import replace

import numpy as np
import pytest

from footscan.cloud.outliers.other_laser import is_of_other_laser, is_off_heel
from footscan.cloud.points import make_points
from footscan.cloud.views import View
from schemas.calibration import LaserPlane

UPPER, LOWER = (LaserPlane(head=head, offset_mm=offset, sd=[0.0] * 7) for head, offset in ((1, 1.5), (2, -1.5)))
VIEWS = {
    1: View(np.array([200.0, 0.0, 250.0]), np.empty((0, 2)), UPPER),
    2: View(np.array([-200.0, 40.0, 250.0]), np.empty((0, 2)), UPPER),
    3: View(np.array([200.0, -80.0, 200.0]), np.empty((0, 2)), LOWER),
}


LOWER_PAIR = {**VIEWS, 4: View(np.array([200.0, -77.0, 202.0]), np.empty((0, 2)), LOWER)}
AT_ONCE = {1: 0.0, 2: 0.0, 3: 0.0}


def scene(
    views: dict[int, View] = VIEWS, steepness: float = 0.3, late: dict[int, float] = AT_ONCE
) -> tuple[np.ndarray, np.ndarray]:
    """A slope that three cameras see in their planes. Camera 3 also sees the stripe of head 1: True for its points.

    steepness : mm in Z per mm in X; late : mm that the heads travel until each camera has exposed its rows
    """

    def slope(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 30.0 + steepness * (x - 50.0) + 0.1 * y

    parts, strange = [], []
    for frame in range(20):
        y = np.arange(-30.0, 30.0, 0.3)
        for camera, view in views.items():
            assert view.plane is not None
            plane = np.full(len(y), 2.0 * frame + view.plane.offset_mm)
            x = plane + late.get(camera, 0.0)
            own = np.column_stack([x, y, slope(x, y)])
            parts.append(make_points(own, camera, frame, plane=plane))
            strange.append(np.zeros(len(y), np.bool_))
        own_plane = 2.0 * frame + LOWER.offset_mm
        x = np.full(len(y), 2.0 * frame + UPPER.offset_mm + late[3])
        there = np.column_stack([x, y, slope(x, y)])
        eye = VIEWS[3].centre + np.array([own_plane + late[3], 0.0, 0.0])
        share = (own_plane + late[3] - x) / (eye[0] - x)
        seen = there + share[:, None] * (eye - there)
        parts.append(make_points(seen, 3, frame, source=1, plane=np.full(len(y), own_plane)))
        strange.append(np.ones(len(y), np.bool_))
    return np.concatenate(parts), np.concatenate(strange)


def test_the_stripe_of_another_head_is_found() -> None:
    points, strange = scene()
    np.testing.assert_array_equal(is_of_other_laser(points, VIEWS)[strange], True)
    assert not is_of_other_laser(points, VIEWS)[~strange].any()


def test_rolling_shutters_hide_no_stripe_of_another_head() -> None:
    points, strange = scene(steepness=3.0, late={1: 0.2, 2: 0.2, 3: -0.2})  # the stripe moves by 1.2 mm in between
    found = is_of_other_laser(points, VIEWS)
    assert found[strange].mean() > 0.95
    assert found[~strange].mean() < 0.05


def test_nothing_is_known_without_planes() -> None:
    points, _ = scene()
    assert not is_of_other_laser(points, {camera: replace(view, plane=None) for camera, view in VIEWS.items()}).any()
    assert not is_of_other_laser(points[:0], VIEWS).any()


def test_planes_that_coincide_hide_nothing() -> None:
    same = {camera: replace(view, plane=LaserPlane(head=camera, sd=[0.0] * 7)) for camera, view in VIEWS.items()}
    points, strange = scene(same)
    assert not is_of_other_laser(points[~strange], same).any()


def test_cameras_that_are_not_synchronised_see_their_own_laser() -> None:
    """On a steep slope the stripe of another moment lies as far off as that of another laser would."""
    same = {camera: replace(view, plane=LaserPlane(head=camera, sd=[0.0] * 7)) for camera, view in VIEWS.items()}
    parts = []
    for camera, ahead in ((1, 0.0), (2, 0.9), (3, 1.7)):
        for frame in range(20):
            y = np.arange(-30.0, 30.0, 0.3)
            x = np.full(len(y), 2.0 * frame + ahead)
            parts.append(make_points(np.column_stack([x, y, 30.0 + 2.0 * x]), camera, frame, plane=x))
    assert not is_of_other_laser(np.concatenate(parts), same).any()


def test_two_lasers_of_one_head_are_two_planes() -> None:
    ahead = LaserPlane(head=2, offset_mm=8.5, sd=[0.0] * 7)
    second = {camera + 64: replace(view, plane=ahead) for camera, view in VIEWS.items() if view.plane is LOWER}
    views = {**VIEWS, **second}
    points, strange = scene(views)
    found = is_of_other_laser(points, views)
    assert not found[~strange].any()
    assert found[strange].mean() > 0.99


def test_lasers_that_are_apart_by_construction_need_no_film_of_a_body() -> None:
    points, strange = scene()
    numbers = {1: 65, 2: 66, 3: 3}  # as if both planes were of one head, the upper one that of laser 2, 3 mm ahead
    points["camera"] = np.vectorize(numbers.get)(points["camera"])
    views = {
        numbers[camera]: replace(view, plane=None, ahead_mm=3.0 if view.plane is UPPER else 0.0)
        for camera, view in VIEWS.items()
    }
    found = is_of_other_laser(points, views)
    assert found[strange].mean() > 0.99
    assert not found[~strange].any()


def test_what_one_camera_alone_sees_beyond_the_end_is_dropped_if_an_extrapolated_end_is_worth_more() -> None:
    points, _ = scene()
    for beyond, dropped in ((2.0, True), (30.0, False)):  # the planes of the two heads are 3 mm apart
        x = points["x"].max() + beyond
        seen = np.column_stack([np.full(30, x), np.linspace(-4.0, 4.0, 30), np.full(30, 80.0)])
        alone = make_points(seen, 1, 20, plane=seen[:, 0])
        found = is_of_other_laser(np.concatenate([points, alone]), VIEWS)
        np.testing.assert_array_equal(found[len(points) :], dropped)


def test_cameras_of_one_head_do_not_confirm_each_other_in_the_stripe_of_another_one() -> None:
    """The first stripe on a heel is that of the laser that stands ahead; cameras of one head displace it alike."""
    views = LOWER_PAIR
    points, _ = scene(views)
    y = np.arange(-6.0, 6.0, 0.3)
    x = np.full(len(y), 40.0 + UPPER.offset_mm)
    first = np.column_stack([x, y, 30.0 + 0.3 * (x - 50.0) + 0.1 * y])
    own_plane = 40.0 + LOWER.offset_mm
    mistaken = []
    for camera in (3, 4):
        eye = views[camera].centre + np.array([own_plane, 0.0, 0.0])
        share = (own_plane - x) / (eye[0] - x)
        seen = first + share[:, None] * (eye - first)
        mistaken.append(make_points(seen, camera, 20, plane=np.full(len(y), own_plane)))
    noisy = first + np.outer(np.linspace(0.0, 0.4, len(y)), [0.0, 0.0, 1.0])
    alone = make_points(noisy, 1, 20, plane=x)
    found = is_of_other_laser(np.concatenate([points, *mistaken, alone]), views)[len(points) :]
    np.testing.assert_array_equal(found, np.repeat([True, True, False], len(y)))


@pytest.mark.parametrize("next_toe_is_longer", [False, True])
@pytest.mark.parametrize(("apart_mm", "is_dropped"), [(0.02, False), (0.15, True)])
def test_a_stripe_on_which_cameras_hardly_agree_makes_no_end(
    apart_mm: float, is_dropped: bool, next_toe_is_longer: bool
) -> None:
    """Cameras of two heads meet by chance in the plane of one of them, beyond the foot, or beyond one of its toes."""
    points, _ = scene()
    if next_toe_is_longer:
        longer = points[points["y"] > 15.0]
        for name, way in (("frame", 18), ("x", 36.0), ("plane", 36.0)):
            longer[name] += way
        points = np.concatenate([points, longer])
    y = np.arange(-6.0, 6.0, 0.3)
    own_plane, plane = 44.0 + UPPER.offset_mm, 44.0 + LOWER.offset_mm
    beyond = np.column_stack([np.full(len(y), own_plane), y, np.full(len(y), 35.0)])
    eye = VIEWS[3].centre + np.array([plane, 0.0, 0.0])
    met = beyond + np.array([0.0, 0.0, apart_mm])
    elsewhere = met + ((plane - own_plane) / (eye[0] - own_plane)) * (eye - met)
    ends = [make_points(beyond, 1, 22, plane=beyond[:, 0]), make_points(elsewhere, 3, 22, plane=elsewhere[:, 0])]
    found = is_of_other_laser(np.concatenate([points, *ends]), VIEWS)[len(points) :]
    np.testing.assert_array_equal(found[: len(y)], is_dropped)


def test_the_last_stripe_is_of_some_laser() -> None:
    """Both cameras of head 2 agree on it, and what each camera of head 1 sees fits one of them as well: nothing is
    certain, but some laser made the stripe."""
    views = {**VIEWS, 4: View(np.array([-200.0, -80.0, 200.0]), np.empty((0, 2)), LOWER)}
    points, _ = scene(views)
    behind = np.full(60, 40.0 + LOWER.offset_mm)
    tip = np.column_stack([behind, np.linspace(-9.0, 9.0, 60), np.full(60, 60.0)])
    seen = []
    for camera, of_head_1 in ((3, 1), (4, 2)):
        seen.append(make_points(tip, camera, 20, plane=behind))
        sight = views[camera].centre - np.column_stack([np.zeros(60), tip[:, 1:]])
        ahead = UPPER.offset_mm - LOWER.offset_mm
        other = tip + (ahead / sight[:, 0])[:, None] * sight
        other[:, 0] = behind + ahead
        seen.append(make_points(other, of_head_1, 20, plane=other[:, 0]))
    found = is_of_other_laser(np.concatenate([points, *seen]), views)[len(points) :]
    np.testing.assert_array_equal(found, np.repeat([False, True, False, True], 60))


def test_the_stripe_of_another_laser_on_a_cap_that_nobody_else_sees_is_found() -> None:
    """It comes to lie within the foot, 1 mm behind the last confirmed place; the other plane is 3 mm ahead of it."""
    points, _ = scene(LOWER_PAIR)
    np.testing.assert_array_equal(found_in(points, alone(20, y=(-3.0, 3.0), z=(60.0, 60.0))), True)


def test_a_stripe_that_nobody_else_sees_counts_where_it_continues_one_that_others_see() -> None:
    points, _ = scene(LOWER_PAIR)
    np.testing.assert_array_equal(found_in(points, alone(11, y=(-3.0, 3.0), z=(60.0, 60.0))), True)
    np.testing.assert_array_equal(found_in(points, alone(11, y=(30.0, 36.0), z=(24.2, 28.0))), False)


@pytest.mark.parametrize("tremor_mm", [0.0, 0.4])
def test_the_stripe_of_another_laser_on_a_heel_is_found_when_the_foot_is_held_still(tremor_mm: float) -> None:
    """Camera 3 sees the first ring of head 1 before its own laser meets the heel, a sphere that begins at X = 2 mm."""
    angles, radius = np.linspace(0.0, 2.0 * np.pi, 150, endpoint=False), 30.0
    parts = []
    for frame in range(1, 8):
        for camera, plane in ((1, UPPER), (2, UPPER), (3, LOWER)):
            x = 2.0 * frame + plane.offset_mm
            if x > 2.0:
                across = np.sqrt(2.0 * radius * (x - 2.0) - (x - 2.0) ** 2)
                ring = np.column_stack([np.full(150, x), across * np.cos(angles), 40.0 + across * np.sin(angles)])
                parts.append(make_points(ring, camera, frame, plane=ring[:, 0]))
    first = parts[0]
    there = np.column_stack([first["x"], first["y"], first["z"]]).astype(np.float64)
    own_plane = 2.0 + LOWER.offset_mm
    eye = VIEWS[3].centre + np.array([own_plane, 0.0, 0.0])
    seen = there + ((own_plane - there[0, 0]) / (eye[0] - there[0, 0])) * (eye - there)
    points = np.concatenate([*parts, make_points(seen, 3, 1, plane=seen[:, 0])])
    shift = tremor_mm * (-1.0) ** points["frame"]
    points["x"] += shift
    points["plane"] += shift
    found = is_off_heel(points, VIEWS)
    assert not found[: -len(seen)].any()
    np.testing.assert_array_equal(found[-len(seen) :], tremor_mm == 0.0)


def alone(frame: int, y: tuple[float, float], z: tuple[float, float]) -> np.ndarray:
    """A straight stripe that camera 3 sees; the slope ends at Y 30 mm, where it is 24.2 mm high in frame 11."""
    x = np.full(20, 2.0 * frame + LOWER.offset_mm)
    return make_points(np.column_stack([x, np.linspace(*y, 20), np.linspace(*z, 20)]), 3, frame, plane=x)


def found_in(points: np.ndarray, more: np.ndarray) -> np.ndarray:
    return is_of_other_laser(np.concatenate([points, more]), LOWER_PAIR)[len(points) :]
