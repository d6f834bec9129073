"""The planes of the body, and parts beside it."""

from collections.abc import Callable

import numpy as np
import pytest

from footscan.cloud.outliers.body import body_range, is_apart
from footscan.cloud.points import make_points

Film = Callable[..., tuple[np.ndarray, np.ndarray]]
ENDS = 10.0, 110.0
"""X of the ellipsoid's ends."""


def rod(camera: int, x: np.ndarray, y: float, z: float, step_mm: float = 0.4) -> np.ndarray:
    """A rod 10 mm long, seen by one camera in all planes at `x`."""
    along = np.arange(0.0, 10.0, step_mm)
    xyz = [[place, y + away, z] for place in x for away in along]
    return make_points(np.array(xyz), camera=camera, frame=np.repeat(np.arange(len(x)), len(along)))


@pytest.mark.parametrize("step", [1.0, 2.0, 5.0])
def test_the_body_is_where_cameras_agree(ellipsoid: Film, step: float) -> None:
    clean, _ = ellipsoid(step=step)
    planes = np.arange(-80.0, 200.0, step)
    rods = [rod(camera, planes, 10.0 * camera - 50.0, 60.0 + 3.0 * camera) for camera in (1, 3, 4, 7)]
    found = body_range(np.concatenate([clean, *rods]))
    assert found is not None
    for end, place, way in zip(ENDS, found, (1, -1), strict=True):
        assert -1.0 <= way * (end - place) < 10.0 + 3 * step
    alone = body_range(clean)
    assert alone is not None
    np.testing.assert_allclose(alone, found, atol=2 * step)


def test_a_chance_agreement_elsewhere_is_no_body(ellipsoid: Film) -> None:
    clean, _ = ellipsoid()
    planes = np.arange(160.0, 180.0, 2.0)
    found = body_range(np.concatenate([clean, rod(1, planes, 0.0, 30.0), rod(2, planes, 0.0, 30.0)]))
    assert found is not None
    assert found[1] < 125.0


def test_without_agreement_there_is_no_body(ellipsoid: Film) -> None:
    clean, _ = ellipsoid()
    assert body_range(clean[clean["camera"] == 3]) is None
    assert body_range(np.concatenate([rod(1, np.arange(20.0), 0.0, 0.0), rod(2, np.arange(20.0), 0.0, 50.0)])) is None


def test_a_part_apart_needs_two_cameras(ellipsoid: Film) -> None:
    clean, _ = ellipsoid()
    planes = np.arange(40.0, 70.0, 2.0)
    toe = np.concatenate([rod(1, planes, 50.0, 20.0), rod(3, planes, 50.4, 20.2)])
    clutter = rod(2, planes, -60.0, 20.0)
    apart = is_apart(np.concatenate([clean, toe, clutter]))
    assert not apart[: len(clean) + len(toe)].any()
    assert apart[len(clean) + len(toe) :].all()
