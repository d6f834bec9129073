import numpy as np
import pytest

from footscan.cloud.lasers.parted import FARTHEST_MM, parted_mm
from footscan.cloud.points import make_points

PLACE = np.array([[100.0, 10.0, 40.0]])


def test_the_nearest_stripe_of_the_same_frame_and_camera_counts() -> None:
    own = make_points(PLACE, camera=3, frame=7)
    beside = PLACE + np.array([0.0, 0.6, 0.8])
    both = make_points(np.concatenate([beside, PLACE + 4.0]), camera=3, frame=7)
    assert parted_mm(own, both)[0] == pytest.approx(1.0, abs=1e-5)
    assert parted_mm(own, make_points(beside, camera=3, frame=8))[0] == np.inf
    assert parted_mm(own, make_points(beside, camera=4, frame=7))[0] == np.inf


def test_what_is_far_away_is_not_beside() -> None:
    own = make_points(PLACE, camera=3)
    assert parted_mm(own, make_points(PLACE + np.array([0.0, FARTHEST_MM + 0.1, 0.0]), camera=3))[0] == np.inf
    assert parted_mm(own, own[:0])[0] == np.inf
    assert len(parted_mm(own[:0], own)) == 0
