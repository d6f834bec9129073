import numpy as np
import pytest

from footscan.cloud.lasers.moments import of_any_laser
from footscan.cloud.outliers.contested import contested_ends
from footscan.cloud.points import make_points
from footscan.cloud.views import View
from schemas.calibration import LaserPlane

VIEWS = {
    camera: View(np.zeros(3), np.empty((0, 2)), LaserPlane(head=camera, offset_mm=offset, sd=[0.0] * 7))
    for camera, offset in ((1, 1.5), (2, -1.5))
}


def foot(camera: int, frames: range) -> np.ndarray:
    """A flat foot 40 mm broad, whose stripes are 2 mm apart."""
    plane = VIEWS[camera].plane
    assert plane is not None
    frame = np.repeat(frames, 40)
    x = 2.0 * frame + plane.offset_mm
    xyz = np.column_stack([x, np.tile(np.linspace(-20.0, 20.0, 40), len(frames)), np.full(len(x), 30.0)])
    return make_points(xyz, camera, frame, plane=x)


@pytest.mark.parametrize("dropped", [1, 2, 3])
@pytest.mark.parametrize("camera", [1, 2])
def test_stripes_of_another_laser_show_the_foot_in_the_plane_nearest_to_its_middle(camera: int, dropped: int) -> None:
    kept = np.concatenate([foot(1, range(20)), foot(2, range(20))])
    first, last = kept["x"].min(), kept["x"].max()
    after, before = foot(camera, range(20, 20 + dropped)), foot(camera, range(-dropped, 0))
    none = kept[:0]
    ends = contested_ends(kept, none, of_any_laser(np.concatenate([after, before]), VIEWS))
    # head 1 is 3 mm ahead: what it may have seen first lies there, and what head 2 may have seen last
    assert ends == pytest.approx((min(first, -2.0 * dropped + 1.5), max(last, 2.0 * (19 + dropped) - 1.5)))


def test_heads_whose_planes_are_not_known_contest_nothing() -> None:
    kept = foot(1, range(20))
    unknown = {1: View(np.zeros(3), np.empty((0, 2)))}
    assert contested_ends(kept, kept[:0], of_any_laser(foot(1, range(20, 23)), unknown)) == (1.5, 39.5)
