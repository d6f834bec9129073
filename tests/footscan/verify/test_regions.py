import functools

import numpy as np
import pytest
import trimesh

from footscan.verify.regions import ANKLE, REGIONS, SOLE, foot_regions
from footscan.virtual.foot.foot import Foot, Side, make_foot, placed

NOTHING = np.zeros((0, 3), np.int32)


@functools.cache
def foot(side: Side) -> Foot:
    return make_foot(side=side, resolution_mm=2.0)


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("turn", [0.0, 140.0])
def test_landmarks_lie_in_their_regions(side: Side, turn: float) -> None:
    scanned = placed(foot(side), 40.0, -15.0, turn)
    regions = foot_regions((scanned.vertices, scanned.faces))
    assert regions is not None
    assert regions.side == side
    assert regions.length == pytest.approx(scanned.measures["foot_length"], abs=0.5)
    expected = {
        "pternion": "heel",
        "metatarsale_tibiale": "ball",
        "metatarsale_fibulare": "ball",
        "landing_point": "sole",
        "toe_1_tip": "toes",
        "toe_5_tip": "toes",
        "junction_point": "ankle",
    }
    places = np.array([scanned.landmarks[name] for name in expected])
    high = places + np.array([0, 0, 15.0])  # tips of toes and the ball's sides stand near the sole's limit
    names = dict(zip(expected, (REGIONS[k] for k in regions.of(high)), strict=True))
    del names["landing_point"]
    assert names == {name: region for name, region in expected.items() if name != "landing_point"}
    assert REGIONS[regions.of(scanned.landmarks["landing_point"][None])[0]] == "sole"


def test_limits_are_shares_of_the_length() -> None:
    whole = foot("right")
    regions = foot_regions((whole.vertices, whole.faces))
    assert regions is not None
    shares = np.array([[0.26, 0.1], [0.27, 0.1], [0.53, 0.1], [0.54, 0.1], [0.79, 0.1], [0.81, 0.1], [-0.1, 0.1]])
    heights = np.array([[0.3, SOLE - 0.001], [0.3, SOLE], [0.3, ANKLE - 0.001], [0.3, ANKLE], [0.9, -1.0], [0.9, 2.0]])
    x, z = np.concatenate([shares, heights]).T * regions.length
    points = np.column_stack([x, np.zeros(len(x)), z, np.ones(len(x))]) @ np.linalg.inv(regions.transform).T
    names = [REGIONS[k] for k in regions.of(points[:, :3])]
    assert names[:7] == ["heel", "midfoot", "midfoot", "ball", "ball", "toes", "heel"]
    assert names[7:] == ["sole", "midfoot", "midfoot", "ankle", "sole", "ankle"]


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.box(extents=(150, 100, 50)),
        trimesh.creation.box(extents=(260, 95, 70)),
        trimesh.creation.icosphere(radius=100),
        trimesh.creation.icosphere(radius=1).apply_scale([130, 45, 35]),
        trimesh.creation.cylinder(radius=40, height=260).apply_transform(
            [[0, 0, 1, 0], [0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1]]
        ),
        trimesh.creation.icosphere(radius=1),
    ],
    ids=["block", "shoe box", "ball", "egg", "pipe", "bead"],
)
def test_what_is_no_foot_has_no_regions(mesh: trimesh.Trimesh) -> None:
    assert foot_regions((np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int32))) is None


def test_clouds_sheets_and_feet_upside_down_have_no_regions() -> None:
    whole = foot("right")
    assert foot_regions((whole.vertices, NOTHING)) is None
    for flat in ([1, 1, 0], [1, 0, 1]):
        assert foot_regions((whole.vertices * flat, whole.faces)) is None
    assert foot_regions((np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32))) is None
    assert foot_regions((whole.vertices * [1, -1, -1], whole.faces)) is None
