import numpy as np
import pytest

from footscan.cloud.outliers.visibility import CONFIRMED, DENIED, UNKNOWN, ask_others, sight_of
from footscan.cloud.views import View
from footscan.mesh.voxels import voxelise

RADIUS_MM = 150.0
WIDE = np.array([[-100.0, -100.0], [100.0, -100.0], [100.0, 100.0], [-100.0, 100.0]])
LEFT, RIGHT = View(np.array([100.0, 150.0, 200.0]), WIDE), View(np.array([-100.0, -150.0, 200.0]), WIDE)


def sheet(z: float, half: float = 30.0, middle: float = 0.0) -> np.ndarray:
    x, y = np.meshgrid(np.arange(0.0, 81.0, 2.0), np.arange(middle - half, middle + half + 0.1, 0.4), indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)])


def answers(
    parts: list[tuple[int, np.ndarray]], views: list[View | None], filmed: list[np.ndarray | None] | None = None
) -> list[np.ndarray]:
    """The answers for the points of each part, (number of its camera, points)."""
    xyz = np.concatenate([points for _, points in parts])
    camera = np.concatenate([np.full(len(points), number, np.uint8) for number, points in parts])
    voxels = voxelise(xyz, (2.0, 1.0, 1.0))
    sight = sight_of(xyz, camera, filmed or [None] * len(views), voxels)
    answer = ask_others(xyz, camera, voxels.voxel, views, voxels, sight)
    return np.split(answer, np.cumsum([len(points) for _, points in parts])[:-1])


def middle_of(answer: np.ndarray, points: np.ndarray) -> np.ndarray:
    inner = (points[:, 0] > 30) & (points[:, 0] < 50) & (np.abs(points[:, 1] - points[:, 1].mean()) < 4)
    return answer[inner]


def test_what_two_cameras_see_is_confirmed() -> None:
    for answer in answers([(0, sheet(0.0)), (1, sheet(0.5))], [LEFT, RIGHT]):
        assert (answer == CONFIRMED).all()


@pytest.mark.parametrize("height", [6.0, 15.0])
def test_what_floats_before_what_another_camera_sees_is_denied(height: float) -> None:
    floating = sheet(height, half=6.0)
    _, answer = answers([(1, sheet(0.0)), (0, floating)], [LEFT, RIGHT])
    assert (middle_of(answer, floating) == DENIED).all()


def test_what_lies_behind_what_others_see_is_denied() -> None:
    behind = sheet(-8.0, half=6.0)
    _, answer = answers([(1, sheet(0.0)), (0, behind)], [LEFT, RIGHT])
    assert (middle_of(answer, behind) == DENIED).all()


def test_what_is_hidden_from_the_other_camera_is_unknown() -> None:
    """A wall stands between the ground and the right camera, which sees the wall's other side alone."""
    x, z = np.meshgrid(np.arange(0.0, 81.0, 2.0), np.arange(0.0, 60.1, 0.4), indexing="ij")
    wall = np.column_stack([x.ravel(), np.full(x.size, -8.0), z.ravel()])
    ground = sheet(0.0, half=6.0, middle=2.0)
    _, answer = answers([(1, wall), (0, ground)], [LEFT, RIGHT])
    assert (middle_of(answer, ground) == UNKNOWN).all()


def test_what_lies_outside_of_the_others_outline_is_unknown() -> None:
    narrow = View(RIGHT.centre, np.array([[-100.0, -100.0], [-20.0, -100.0], [-20.0, 100.0], [-100.0, 100.0]]))
    own = sheet(0.0, half=6.0)
    _, answer = answers([(1, sheet(0.0, 5.0, -40.0)), (0, own)], [LEFT, narrow])
    assert (answer == UNKNOWN).all()


def test_a_camera_without_a_picture_of_the_plane_is_not_asked() -> None:
    own = sheet(0.0)
    _, answer = answers([(1, sheet(40.0)[:1]), (0, own)], [LEFT, RIGHT])
    assert (middle_of(answer, own) == UNKNOWN).all()


@pytest.mark.parametrize("views", [[None, None], [LEFT, None], [None, RIGHT]])
def test_cameras_of_unknown_place(views: list[View | None]) -> None:
    floating = sheet(9.0, half=6.0)
    answer = answers([(1, sheet(0.0)), (0, floating)], views)[1]
    assert set(np.unique(answer)) <= {UNKNOWN, DENIED}


def test_a_camera_that_filmed_the_plane_and_saw_nothing_denies() -> None:
    own = sheet(0.0)
    seen = [(1, sheet(40.0)[:1]), (0, own)]
    planes = np.arange(0.0, 81.0, 2.0)
    assert (middle_of(answers(seen, [LEFT, RIGHT], [None, planes])[1], own) == DENIED).all()
    planes[10:30] = np.nan  # lost
    assert (middle_of(answers(seen, [LEFT, RIGHT], [None, planes])[1], own) == UNKNOWN).all()


def test_a_camera_that_is_nearly_blind_denies_nothing() -> None:
    """Two cameras agree on the ground; the third saw a spot of it. What one of them sees above, it does not deny."""
    planes = np.arange(0.0, 81.0, 2.0)
    third = View(np.array([100.0, -150.0, 200.0]), WIDE)
    ground, own = sheet(0.0, half=20.0), sheet(0.0, half=6.0, middle=60.0)
    parts = [(0, ground), (1, ground), (2, ground[:40]), (0, own)]
    narrow = View(RIGHT.centre, np.array([[-40.0, -100.0], [40.0, -100.0], [40.0, 100.0], [-40.0, 100.0]]))
    views: list[View | None] = [LEFT, narrow, third]
    blind = answers(parts, views, [planes, planes, planes])[3]
    assert (middle_of(blind, own) == UNKNOWN).all()
    parts[2] = (2, ground)
    witness = answers(parts, views, [planes, planes, planes])[3]
    assert (middle_of(witness, own) == DENIED).all()


def test_a_reflection_that_two_cameras_see_behind_a_surface_of_three_is_denied() -> None:
    third = View(np.array([100.0, -150.0, 200.0]), WIDE)
    surface, behind = sheet(0.0), sheet(-8.0, half=6.0)
    parts = [(0, surface), (1, surface), (2, surface), (0, behind), (1, behind)]
    planes = np.arange(0.0, 81.0, 2.0)
    found = answers(parts, [LEFT, RIGHT, third], [planes] * 3)
    for answer in found[3:]:
        assert (middle_of(answer, behind) == DENIED).all()
    for answer in found[:3]:
        assert (answer == CONFIRMED).all()


def test_skin_does_not_hide_what_lies_farther_round() -> None:
    """A cylinder along X: the sight of one camera grazes what three see on its way to what two see."""

    def cylinder(first: float, last: float) -> np.ndarray:
        """From `first` to `last` degrees from the direction of the left camera, which sees up to 68."""
        x, angle = np.meshgrid(np.arange(0.0, 81.0, 2.0), np.radians(np.arange(first, last, 0.15)), indexing="ij")
        angle += np.arctan2(LEFT.centre[2] + RADIUS_MM, LEFT.centre[1])
        y, z = RADIUS_MM * np.cos(angle), RADIUS_MM * (np.sin(angle) - 1.0)
        return np.column_stack([x.ravel(), y.ravel(), z.ravel()])

    third = View(np.array([-100.0, 0.0, 200.0]), WIDE)
    near, round_the_side = cylinder(40.0, 60.0), cylinder(60.0, 67.0)
    parts = [(0, near), (1, near), (2, near), (0, round_the_side), (1, round_the_side)]
    found = answers(parts, [LEFT, RIGHT, third], [np.arange(0.0, 81.0, 2.0)] * 3)
    for answer in found:
        assert (answer == CONFIRMED).all()
