import os
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footscan.measure.foot_landmarks import Landmark, check_manual, find_landmarks
from footscan.measure.frame.foot_frame import foot_frame
from footscan.measure.landmarks.dorsal import instep_point
from footscan.mesh.formats.files import read_mesh
from footscan.virtual.foot.foot import Foot, make_foot, sample_shape
from schemas.base.errors import Finding
from schemas.landmarks import LANDMARKS

FEET = range(4)


@lru_cache
def known_foot(number: int) -> Foot:
    """One of the population; those of odd numbers are left."""
    shape = sample_shape(np.random.default_rng(number), "female" if number % 3 else "male")
    return make_foot(shape, side="left" if number % 2 else "right", resolution_mm=2.0)


def found_on(foot: Foot, number: int, noise: float = 0.0) -> dict[str, Landmark]:
    """In a pose of its own."""
    random = np.random.default_rng(number)
    pose, shift = Rotation.random(random_state=number), random.uniform(-300, 300, 3)
    vertices = pose.apply(foot.vertices + random.normal(0, noise, foot.vertices.shape)) + shift
    return find_landmarks(foot_frame(vertices, foot.faces, foot.side))


def known_on(foot: Foot) -> dict[str, np.ndarray]:
    mirror = np.array([1.0, 1.0 if foot.side == "right" else -1.0, 1.0])
    return {name: point * mirror for name, point in foot.landmarks.items()}


@pytest.mark.parametrize("number", FEET)
def test_landmarks_are_where_the_foot_was_built_with_them(number: int) -> None:
    foot = known_foot(number)
    found = found_on(foot, number)
    assert set(found) == set(LANDMARKS) - {"navicular", "fifth_metatarsal_tuberosity"}, "its sides are even"
    known = known_on(foot)
    off = {name: found[name].point - point for name, point in known.items()}
    assert off["pternion"][:2] == pytest.approx([0, 0], abs=0.02)
    # Along the foot the sides of the ball are nearly straight: over 0.3 mm they fall by 0.001 mm.
    assert off["metatarsale_tibiale"][:2] == pytest.approx([0, 0], abs=0.3)
    assert abs(off["metatarsale_tibiale"][1]) < 0.05
    assert off["metatarsale_fibulare"][:2] == pytest.approx([0, 0], abs=0.3)
    assert abs(off["metatarsale_fibulare"][1]) < 0.08
    for toe in range(1, 6):
        assert off[f"toe_{toe}_tip"] == pytest.approx([0, 0, 0], abs=0.3)
        assert abs(off[f"toe_{toe}_tip"][0]) < 0.05
    # The known landing point counts cells of 0.5 mm, the last one beyond a quarter of the length.
    assert off["landing_point"] == pytest.approx([-0.12, 0, 0], abs=0.25)
    assert off["junction_point"] == pytest.approx([0, 0, 0], abs=0.2)
    breadth = found["heel_medial"].point[1] - found["heel_lateral"].point[1]
    assert breadth == pytest.approx(foot.measures["heel_breadth"], abs=0.25)
    assert {found[name].method for name in known} == {"geometric"}


@pytest.mark.parametrize("number", FEET[:2])
def test_landmarks_in_noise(number: int) -> None:
    foot = known_foot(number)
    found = found_on(foot, number, noise=0.3)
    off = {name: found[name].point - point for name, point in known_on(foot).items()}
    # The axis turns with the tip of the toe that it ends at, and with it all that lies ahead: breadths do not.
    breadth = found["metatarsale_tibiale"].point[1] - found["metatarsale_fibulare"].point[1]
    assert breadth == pytest.approx(foot.measures["foot_breadth"], abs=0.4)
    assert max(abs(off[f"toe_{toe}_tip"][0]) for toe in range(1, 6)) < 0.7
    assert abs(off["metatarsale_tibiale"][0]) < 2.0
    quiet = found_on(foot, number)
    assert all(found[name].confidence < quiet[name].confidence for name in ("pternion", "metatarsale_tibiale"))


def test_malleoli_stand_out_of_the_leg() -> None:
    foot = known_foot(0)
    found = found_on(foot, 0)
    length = foot.measures["foot_length"]
    # The form has ellipsoids there, at these parts of the length.
    assert found["medial_malleolus"].point[0] == pytest.approx(0.245 * length, abs=2.0)
    assert found["lateral_malleolus"].point[0] == pytest.approx(0.205 * length, abs=2.0)
    assert found["medial_malleolus"].point[2] > found["lateral_malleolus"].point[2]


def test_a_low_cut_leaves_no_ankle() -> None:
    foot = known_foot(0)
    low = foot.faces[foot.vertices[foot.faces][:, :, 2].max(axis=1) < 55]
    found = find_landmarks(foot_frame(foot.vertices + np.array([0, 0, 20]), low, "right"))
    assert not {"medial_malleolus", "lateral_malleolus", "junction_point"} & set(found)
    whole = found_on(foot, 0)
    assert found["metatarsale_tibiale"].point == pytest.approx(whole["metatarsale_tibiale"].point, abs=0.02)


def test_points_that_a_person_has_set_count_first() -> None:
    foot = known_foot(1)
    pose = Rotation.random(random_state=3)
    frame = foot_frame(pose.apply(foot.vertices) + 50, foot.faces, "left")
    own = np.array([100.0, -20.0, 30.0])  # a left foot's medial side is -Y
    found = find_landmarks(frame, {"navicular": pose.apply(own) + 50})
    assert found["navicular"].point == pytest.approx([100.0, 20.0, 30.0], abs=0.05)
    assert (found["navicular"].method, found["navicular"].confidence) == ("manual", 1.0)
    # The heads' tops follow the metatarsal points.
    moved = find_landmarks(frame, {"metatarsale_tibiale": pose.apply([190.0, -40.0, 20.0]) + 50})
    assert moved["first_metatarsal_head_top"].point[0] != pytest.approx(found["first_metatarsal_head_top"].point[0])


def test_an_unknown_name_is_refused() -> None:
    frame = foot_frame(known_foot(1).vertices, known_foot(1).faces, "left")
    with pytest.raises(KeyError, match="navicula"):
        find_landmarks(frame, {"navicula": np.zeros(3)})


def test_points_far_from_the_surface_are_refused() -> None:
    foot = make_foot(resolution_mm=3.0)
    check_manual({"navicular": foot.vertices[100] + [0.0, 0.0, 15.0]}, foot.vertices)
    with pytest.raises(ValueError, match=r"navicular lies \d+ mm from the surface"):
        check_manual({"navicular": foot.vertices[100] + [0.0, 900.0, 0.0]}, foot.vertices)


def test_exchanged_heads_of_the_metatarsals_are_refused() -> None:
    foot = make_foot(resolution_mm=3.0)
    found = foot_frame(foot.vertices, foot.faces, "right")
    ball = {name: foot.landmarks[name] for name in ("metatarsale_tibiale", "metatarsale_fibulare")}
    assert find_landmarks(found, ball)["metatarsale_tibiale"].method == "manual"
    exchanged = dict(zip(ball, reversed(ball.values()), strict=True))
    with pytest.raises(Finding, match="exchanged"):
        find_landmarks(found, exchanged)


def test_a_missing_toe_leaves_the_others_their_numbers() -> None:
    foot = known_foot(0)
    tip, length = foot.landmarks["toe_4_tip"], foot.measures["foot_length"]
    x, y, _ = foot.vertices.T
    short = foot.vertices.copy()
    of_toe = (np.abs(y - tip[1]) < 7.5) & (x > 0.78 * length)
    short[of_toe, 0] = 0.78 * length + 0.1 * (x[of_toe] - 0.78 * length)
    found = find_landmarks(foot_frame(short, foot.faces, "right"))
    known = known_on(foot)
    assert "toe_4_tip" not in found
    for toe in (1, 2, 3, 5):
        assert found[f"toe_{toe}_tip"].point[:2] == pytest.approx(known[f"toe_{toe}_tip"][:2], abs=0.5)
        assert "4 of five" in (found[f"toe_{toe}_tip"].note or "")


def test_landmarks_of_a_real_foot() -> None:
    data = os.environ.get("FOOTSCAN_DATA")
    if not data:
        pytest.skip("FOOTSCAN_DATA is not set")
    vertices, faces = read_mesh(Path(data) / "find" / "template.obj")
    frame = foot_frame(vertices * 1000, faces, "unknown")
    assert (frame.side, frame.axis) == ("left", "toe2")
    found = find_landmarks(frame)
    share = {name: landmark.point / frame.length for name, landmark in found.items()}
    assert [share[f"toe_{toe}_tip"][0] for toe in range(1, 6)] == sorted(
        (share[f"toe_{toe}_tip"][0] for toe in range(1, 6)), reverse=True
    )
    assert share["metatarsale_tibiale"][0] == pytest.approx(0.74, abs=0.03)
    assert share["metatarsale_fibulare"][0] == pytest.approx(0.64, abs=0.03)
    assert share["junction_point"][0] == pytest.approx(0.40, abs=0.08)
    assert share["medial_malleolus"][2] == pytest.approx(0.31, abs=0.05)


@pytest.mark.parametrize(("bone_mm", "expected", "told"), [(4.0, 0.53, True), (0.3, 0.5, False), (0.0, 0.5, False)])
def test_instep_point_is_where_a_bone_stands_out_else_half_way(bone_mm: float, expected: float, told: bool) -> None:
    length = 260.0
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(60.0, 220.0), np.arange(-20.0, 21.0)))
    bone = bone_mm * np.exp(-0.5 * (x - 0.53 * length) ** 2 / 10.0**2)
    back = np.column_stack([x, y, 100.0 - 0.3 * x + bone - y**2 / 60.0])
    found = instep_point(back, length)
    assert found is not None
    point, by_its_bend = found
    assert by_its_bend == told
    assert point[0] == pytest.approx(expected * length, abs=1.5)
