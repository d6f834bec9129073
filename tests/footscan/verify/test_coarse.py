import numpy as np

from footscan.verify.coarse import corners, distinct, start_poses, super_fibonacci
from footscan.verify.icp import Poses

HALF_TURNS = np.array([np.diag(signs) for signs in ((1.0, -1, -1), (-1, 1, -1), (-1, -1, 1))])


def angles_to(rotations: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(R, O) degrees between them."""
    cosines = (np.einsum("rij,oij->ro", rotations, others) - 1) / 2
    return np.degrees(np.arccos(np.clip(cosines, -1, 1)))


def test_starts_are_rotations_and_leave_no_gap() -> None:
    rotations = start_poses().rotations
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0, atol=1e-12)
    assert len(rotations) == 24 + 4 * 120
    anywhere = super_fibonacci(2000)
    assert angles_to(anywhere, rotations).min(axis=1).max() < 35


def test_starts_do_not_depend_on_the_signs_of_axes() -> None:
    rotations = start_poses().rotations
    for half_turn in HALF_TURNS:
        for turned in (rotations @ half_turn, rotations[:24] @ half_turn, half_turn @ rotations[:24]):
            assert angles_to(turned, rotations).min(axis=1).max() < 1e-4


def test_distinct_poses_by_hand() -> None:
    shifts = np.array([[0.0, 0, 0], [5, 0, 0], [0.5, 0, 0], [5, 0.9, 0]])
    poses = Poses(np.tile(np.eye(3), (4, 1, 1)), shifts)
    points = np.array([[0.0, 0, 0], [1, 2, 3]])
    kept, starts = distinct(poses, np.array([10, 20, 3, 4]), points, 1.0)
    np.testing.assert_array_equal(kept.translations, shifts[:2])
    assert starts.tolist() == [13, 24]


def test_corners_by_hand() -> None:
    expected = {(x, y, z) for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (-3.0, 0.0)}
    assert {tuple(corner) for corner in corners(np.array([[0.0, 2, 0], [1, 0, -3]])).tolist()} == expected
