from functools import lru_cache
from typing import Literal

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footscan.measure.frame.foot_frame import FootFrame, foot_frame
from footscan.measure.frame.glass import to_glass
from footscan.mesh.rigid_transform import apply
from footscan.virtual.foot.foot import Foot, make_foot, sample_shape
from schemas.base.errors import Finding
from schemas.base.model import Side
from schemas.glass import Plane
from schemas.measures import Axis

ABOVE_GLASS = np.array([120.0, -40.0, 33.0])
POSES = {
    "upright": Rotation.identity(),
    "turned": Rotation.from_euler("z", 137, degrees=True),
    "sole up": Rotation.from_euler("xz", [180, 20], degrees=True),
    "on its side": Rotation.from_euler("x", 90, degrees=True),
    "on its toes": Rotation.from_euler("y", 70, degrees=True),
    "tilted": Rotation.from_euler("xyz", [25, -10, 200], degrees=True),
}


@lru_cache
def known_foot(side: Literal["left", "right"]) -> Foot:
    return make_foot(sample_shape(np.random.default_rng(4), "female"), side=side, resolution_mm=2.0)


def framed(foot: Foot, pose: Rotation, side: Side, axis: Axis = "toe2") -> FootFrame:
    return foot_frame(pose.apply(foot.vertices) + ABOVE_GLASS, foot.faces, side, axis)


@pytest.mark.parametrize("pose", POSES.values(), ids=POSES.keys())
@pytest.mark.parametrize("side", ["right", "left"])
def test_a_foot_in_any_pose_comes_to_stand_in_its_own_frame(pose: Rotation, side: Side) -> None:
    foot = known_foot(side)
    frame = framed(foot, pose, side)
    assert (frame.axis, frame.side, frame.side_note, frame.floor) == ("toe2", side, None, "sole")
    assert frame.length == pytest.approx(foot.measures["foot_length"], abs=0.05)
    assert frame.cut_height == pytest.approx(foot.measures["scan_height"], abs=1.5)
    assert frame.floor_residual < 0.02
    mirror = np.array([1.0, 1.0 if side == "right" else -1.0, 1.0])
    np.testing.assert_allclose(frame.vertices, foot.vertices * mirror, atol=0.02)  # it was made in its own frame
    moved = apply(frame.transform, pose.apply(foot.vertices) + ABOVE_GLASS)
    np.testing.assert_allclose(moved, frame.vertices, atol=1e-9)
    assert np.linalg.det(frame.transform[:3, :3]) == pytest.approx(1.0 if side == "right" else -1.0)


@pytest.mark.parametrize("plane", [Plane(-1.5, 0.0, 0.0), Plane(2.2, -0.008, 0.009)])
@pytest.mark.parametrize("side", ["right", "left"])
def test_the_glass_is_the_floor_wherever_it_stands(side: Side, plane: Plane) -> None:
    foot = known_foot(side)
    from_glass = np.linalg.inv(to_glass(plane))
    moved = apply(from_glass, foot.vertices)
    frame, expected = foot_frame(moved, foot.faces, side, glass=plane), foot_frame(foot.vertices, foot.faces, side)
    assert frame.floor == expected.floor == "glass"
    np.testing.assert_allclose(frame.vertices, expected.vertices, atol=0.02)
    np.testing.assert_allclose(frame.transform @ from_glass, expected.transform, atol=2e-4)


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_form_tells_the_side(side: Side) -> None:
    frame = framed(known_foot(side), POSES["tilted"], "unknown")
    assert (frame.side, frame.side_note) == (side, None)
    other: Side = "left" if side == "right" else "right"
    contradicted = framed(known_foot(side), POSES["tilted"], other)
    assert contradicted.side == other
    assert contradicted.side_note == f"toes and ball look like those of a {side} foot"


def test_motion_and_mirroring_change_nothing() -> None:
    foot = known_foot("right")
    upright = framed(foot, POSES["upright"], "right")
    for pose in POSES.values():
        mirrored = foot_frame(pose.apply(foot.vertices * [1, -1, 1]) - ABOVE_GLASS, foot.faces[:, ::-1], "left")
        for frame in (framed(foot, pose, "right"), mirrored):
            np.testing.assert_allclose(frame.vertices, upright.vertices, atol=0.003)
            assert frame.length == pytest.approx(upright.length, abs=0.003)


def test_the_glass_stays_the_floor() -> None:
    foot = known_foot("right")
    sunk = Rotation.from_euler("yz", [0.6, 40], degrees=True).apply(foot.vertices) + np.array([300.0, 20.0, 1.4])
    frame = foot_frame(sunk, foot.faces, "right")
    assert frame.floor == "glass"
    np.testing.assert_array_equal(frame.transform[2], [0.0, 0.0, 1.0, 0.0])


def test_a_sole_without_its_skin_is_a_floor_too() -> None:
    foot = known_foot("left")
    open_sole = foot.faces[foot.vertices[foot.faces][:, :, 2].mean(axis=1) > 3.0]
    frame = foot_frame(POSES["sole up"].apply(foot.vertices) + ABOVE_GLASS, open_sole, "unknown")
    assert (frame.side, frame.axis) == ("left", "toe2")
    assert frame.length == pytest.approx(foot.measures["foot_length"], abs=0.3)


def test_axes() -> None:
    foot, pose = known_foot("right"), POSES["tilted"]
    along = {axis: framed(foot, pose, "right", axis) for axis in ("toe2", "ball_center", "brannock")}
    assert [frame.axis for frame in along.values()] == list(along)
    points = {name: pose.apply(point) + ABOVE_GLASS for name, point in foot.landmarks.items()}

    def seen(axis: str, name: str) -> np.ndarray:
        place: np.ndarray = apply(along[axis].transform, points[name][None])[0]
        return place

    assert seen("toe2", "toe_2_tip")[1] == pytest.approx(0.0, abs=0.05)
    middle = (seen("ball_center", "metatarsale_tibiale") + seen("ball_center", "metatarsale_fibulare")) / 2
    assert middle[1] == pytest.approx(0.0, abs=0.3)  # the outermost points lie elsewhere on an axis turned by 2 degrees
    # No point of heel or ball lies more medial than the tangent that both touch.
    low = along["brannock"].vertices[along["brannock"].vertices[:, 2] < 40]
    length = along["brannock"].length
    heel, ball = (
        low[(low[:, 0] > a * length) & (low[:, 0] < b * length), 1].max() for a, b in ((0.0, 0.3), (0.6, 0.8))
    )
    assert heel == pytest.approx(ball, abs=0.05)


def test_a_marked_second_toe_and_heel_make_the_axis() -> None:
    foot, pose = known_foot("right"), POSES["tilted"]
    heel, toe = np.array([1.0, 3.0, 20.0]), np.array([240.0, -6.0, 10.0])
    marked = {"pternion": pose.apply(heel) + ABOVE_GLASS, "toe_2_tip": pose.apply(toe) + ABOVE_GLASS}
    frame = foot_frame(pose.apply(foot.vertices) + ABOVE_GLASS, foot.faces, "right", marked=marked)
    assert apply(frame.transform, marked["pternion"][None])[0, :2] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert apply(frame.transform, marked["toe_2_tip"][None])[0, 1] == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("noise", [0.1, 0.3])
def test_noise(noise: float) -> None:
    foot = known_foot("right")
    noisy = foot.vertices + np.random.default_rng(1).normal(0, noise, foot.vertices.shape)
    frame = foot_frame(POSES["turned"].apply(noisy) + ABOVE_GLASS, foot.faces, "unknown")
    assert (frame.axis, frame.side) == ("toe2", "right")
    assert frame.length == pytest.approx(foot.measures["foot_length"], abs=1.5 * noise)
    assert frame.floor_residual == pytest.approx(noise, rel=0.5)


def test_a_foot_in_another_unit_is_a_finding() -> None:
    foot = known_foot("right")
    with pytest.raises(Finding, match=r"is 0\.\d+ across, expected a foot in mm"):
        foot_frame(foot.vertices / 1000, foot.faces, "right")
