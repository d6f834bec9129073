import numpy as np
import pytest

from footscan.calibration.models.laser_plane import x_in_plane
from footscan.cloud.lasers.apart import UNKNOWN, between_lasers, lasers_of, planes_apart
from footscan.cloud.points import make_points
from footscan.cloud.views import View
from schemas.calibration import LaserPlane

HEADS = {1: 1, 2: 2}


def view(head: int, **terms: float) -> View:
    return View(np.zeros(3), np.empty((0, 2)), LaserPlane(head=head, sd=[0.0] * 7, **terms))


def test_the_planes_lie_where_the_calibration_says() -> None:
    one, other = view(1, offset_mm=0.5, yaw=0.01, scale=0.001), view(2, offset_mm=-1.0, pitch=0.02, bend_mm=0.1)
    place = np.array([[200.0, 30.0, 80.0]])
    planes = [plane.plane for plane in (one, other) if plane.plane is not None]
    still = np.zeros(1)
    at = [x_in_plane(plane, place[:, 0], place[:, 1:], still, still)[0] for plane in planes]
    cloud = make_points(np.concatenate([place, place]), camera=np.array([1, 2]))
    apart = between_lasers(lasers_of({1: one, 2: other}), place, cloud, HEADS, 6.0)
    assert apart == pytest.approx([at[0] - at[1]])


def test_skin_that_one_laser_lights_is_between_none() -> None:
    planes = lasers_of({1: view(1), 2: view(2, offset_mm=1.5)})
    places = np.array([[100.0, y, 50.0] for y in (-20.0, 0.0, 20.0)])
    cloud = make_points(places[[0, 1, 1, 2]], camera=np.array([1, 1, 2, 2]))
    assert between_lasers(planes, places, cloud, HEADS, 6.0).tolist() == [np.inf, 1.5, np.inf]
    assert between_lasers(planes, places, cloud, HEADS, np.array([25.0, 25.0, 6.0])).tolist() == [1.5, 1.5, np.inf]


def test_planes_that_nothing_has_shown_are_unknown() -> None:
    planes = lasers_of({1: view(1), 2: View(np.zeros(3), np.empty((0, 2)))})
    assert planes is UNKNOWN
    assert planes_apart(planes, (0.0, 250.0)) == np.inf


def test_both_lasers_of_a_head_count() -> None:
    one = view(3)
    ahead = View(one.centre, one.outline, one.plane, camera=5, ahead_mm=12.0)
    assert planes_apart(lasers_of({5: one, 69: ahead}), (0.0, 250.0)) == pytest.approx(12.0)
