"""Points amid the skin of an end are dropped; skin between toes, and what one camera alone sees of an end, stays."""

import numpy as np
import pytest

from footscan.cloud.outliers.inside import is_inside
from footscan.cloud.points import make_points

ANGLES = np.linspace(0.0, 2 * np.pi, 90, endpoint=False)


def cap(radius: float, depths: np.ndarray, middle: float = 0.0) -> np.ndarray:
    """Rings of a sphere that begins at X = 0."""
    ring = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
    rings = [np.insert(np.sqrt(2 * radius * x - x**2) * ring, 0, x, axis=1) for x in depths]
    return np.concatenate(rings) + np.array([0.0, middle, 0.0])


def selected(skin: np.ndarray, stripe: np.ndarray) -> np.ndarray:
    """Of a stripe that camera 2 sees at an end that camera 1 sees."""
    xyz, camera = np.concatenate([skin, stripe]), np.repeat([1, 2], [len(skin), len(stripe)])
    frame = np.rint(10 * xyz[:, 0]).astype(int)
    found = is_inside(make_points(xyz, camera=camera, frame=frame, source=np.arange(len(xyz))))
    assert not found[: len(skin)].any()
    return found[len(skin) :]


def test_a_stripe_behind_the_skin_of_a_heel() -> None:
    heel = cap(30.0, np.arange(0.6, 12.0, 2.0))
    y = np.linspace(-6.0, 2.0, 20)
    assert selected(heel, np.column_stack([np.full(20, 3.1), y, -2.0 + 0.2 * y])).all()


def test_a_cap_that_one_camera_alone_sees_is_kept() -> None:
    heel = cap(30.0, np.arange(2.6, 12.0, 2.0))
    assert not selected(heel, cap(30.0, np.array([0.4, 0.8, 1.6, 2.4]))).any()


@pytest.mark.parametrize("apart", [0.5, 1.0, 2.0, 4.0])
def test_skin_between_toes_is_kept(apart: float) -> None:
    toes = [cap(8.0, np.arange(0.6, 8.0, 1.0), middle) for middle in (-8.0 - apart / 2, 8.0 + apart / 2)]
    instep = cap(60.0, np.arange(9.0, 40.0, 2.0))
    z = np.linspace(-3.0, 3.0, 15)
    cleft = np.column_stack([np.full(15, 7.5), np.zeros(15), z])
    assert not selected(np.concatenate([*toes, instep]), cleft).any()


def test_an_empty_cloud() -> None:
    assert is_inside(make_points(np.zeros((0, 3)), camera=1)).tolist() == []
