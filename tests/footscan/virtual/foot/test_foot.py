"""The known measures against an independent path: plane sections of a fine triangle mesh with trimesh."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
import trimesh
from scipy.spatial import ConvexHull, cKDTree

from footscan.virtual.foot.foot import Foot, FootShape, make_foot, placed, sample_shape
from schemas.base.errors import RefusedInput

Floats = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def foot() -> Foot:
    return make_foot()


@pytest.fixture(scope="module")
def mesh(foot: Foot) -> trimesh.Trimesh:
    return trimesh.Trimesh(foot.vertices, foot.faces, process=False)


def section(mesh: trimesh.Trimesh, normal: tuple[float, float, float], origin: tuple[float, float, float]) -> Floats:
    """The segments (N, 2, 3) in which a plane cuts the mesh."""
    return np.asarray(trimesh.intersections.mesh_plane(mesh, normal, origin))


def tape(mesh: trimesh.Trimesh, normal: tuple[float, float, float], origin: tuple[float, float, float]) -> float:
    points = section(mesh, normal, origin).reshape(-1, 3)
    across = np.cross(normal, (0.0, 0.0, 1.0))
    up = np.cross(across, normal)
    basis = np.column_stack([across / np.linalg.norm(across), up / np.linalg.norm(up)])
    return float(ConvexHull(points @ basis).area)


@pytest.mark.parametrize("resolution", [1.0, 2.0])
@pytest.mark.parametrize("side", ["left", "right"])
def test_is_one_closed_body_with_outward_faces(side: str, resolution: float) -> None:
    foot = make_foot(side="left" if side == "left" else "right", resolution_mm=resolution)
    mesh = trimesh.Trimesh(foot.vertices, foot.faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.body_count == 1
    assert mesh.euler_number == 2  # no handle: the toes are apart
    assert mesh.volume > 0.8e6  # positive: the faces look outward
    assert foot.vertices.dtype == np.float64
    assert foot.faces.dtype == np.int32


def test_stands_in_the_scanners_frame(foot: Foot) -> None:
    low, high = foot.vertices.min(axis=0), foot.vertices.max(axis=0)
    assert low[0] == pytest.approx(0.0, abs=0.01)
    assert low[2] == pytest.approx(0.0, abs=0.002)
    assert high[2] == foot.measures["scan_height"] == 108.0
    assert high[1] - low[1] < 140
    marks = foot.landmarks
    assert marks["pternion"][:2] == pytest.approx([0.0, 0.0])
    assert marks["toe_2_tip"][1] == 0.0
    assert marks["metatarsale_tibiale"][1] > 0 > marks["metatarsale_fibulare"][1]


def test_landmarks_lie_on_the_surface(foot: Foot) -> None:
    distances, _ = cKDTree(foot.vertices).query(np.array(list(foot.landmarks.values())))
    assert distances.max() < 0.9  # vertices are about 1 mm apart


def test_has_the_measures_asked_for(foot: Foot) -> None:
    shape = FootShape()
    names = ("foot_length", "ball_length", "lateral_ball_length", "foot_breadth", "heel_breadth", "instep_height",
             "arch_height", "ball_girth", "scan_height")  # fmt: skip
    for name in names:
        assert foot.measures[name] == pytest.approx(getattr(shape, name), abs=0.02), name
    assert foot.measures["toe_height"] == pytest.approx(shape.hallux_height, abs=0.02)


def test_lengths_and_breadths_agree_with_the_mesh(foot: Foot) -> None:
    x, y, z = foot.vertices.T
    length = x.max() - x.min()
    assert length == pytest.approx(foot.measures["foot_length"], abs=0.05)
    medial = (x > 0.66 * length) & (x < 0.80 * length) & (z < 45)
    lateral = (x > 0.56 * length) & (x < 0.72 * length) & (z < 40)
    assert y[medial].max() - y[lateral].min() == pytest.approx(foot.measures["foot_breadth"], abs=0.05)
    heel = (x >= 0.10 * length) & (x <= 0.20 * length) & (z <= 40)
    assert np.ptp(y[heel]) == pytest.approx(foot.measures["heel_breadth"], abs=0.05)


def test_heights_agree_with_the_mesh(foot: Foot, mesh: trimesh.Trimesh) -> None:
    length = foot.measures["foot_length"]
    middle = section(mesh, (1, 0, 0), (0.5 * length, 0, 0)).reshape(-1, 3)
    assert middle[:, 2].max() == pytest.approx(foot.measures["instep_height"], abs=0.05)
    tip = foot.landmarks["toe_1_tip"]
    toes = section(mesh, (1, 0, 0), (tip[0] - 12.5, 0, 0)).reshape(-1, 3)
    assert toes[toes[:, 1] > tip[1] - 10, 2].max() == pytest.approx(foot.measures["toe_height"], abs=0.05)
    y = middle[:, 1].max() - np.ptp(middle[:, 1]) / 3
    sole = section(mesh, (0, 1, 0), (0, y, 0)).reshape(-1, 3)
    under = sole[(sole[:, 0] > 0.30 * length) & (sole[:, 0] < 0.60 * length) & (sole[:, 2] < 30)]
    assert under[:, 2].max() == pytest.approx(foot.measures["arch_height"], abs=0.05)


def test_girths_agree_with_the_mesh(foot: Foot, mesh: trimesh.Trimesh) -> None:
    length, marks = foot.measures["foot_length"], foot.landmarks
    tibiale, fibulare = marks["metatarsale_tibiale"], marks["metatarsale_fibulare"]
    across = tibiale - fibulare
    ball = tape(mesh, (across[1], -across[0], 0.0), tuple(tibiale))
    assert ball == pytest.approx(foot.measures["ball_girth"], abs=0.1)
    instep = tape(mesh, (1, 0, 0), (0.5 * length, 0, 0))
    assert instep == pytest.approx(foot.measures["instep_girth"], abs=0.1)
    waist_x = 0.5 * (0.5 * length + 0.5 * (tibiale[0] + fibulare[0]))
    assert tape(mesh, (1, 0, 0), (waist_x, 0, 0)) == pytest.approx(foot.measures["waist_girth"], abs=0.1)
    up = marks["junction_point"] - marks["landing_point"]
    heel = tape(mesh, (up[2], 0.0, -up[0]), tuple(marks["junction_point"] * (1, 0, 1)))
    assert heel == pytest.approx(foot.measures["heel_girth"], abs=0.15)


def test_arch_index_agrees_with_the_mesh(foot: Foot, mesh: trimesh.Trimesh) -> None:
    """Contact 1 mm above the floor along lines of constant Y; what begins beyond 0.8 of the length belongs to toes."""
    segments = section(mesh, (0, 0, 1), (0, 0, 1.0))
    spans = []
    for y in np.arange(-60, 60, 0.25) + 0.125:
        (x0, y0), (x1, y1) = segments[:, 0, :2].T, segments[:, 1, :2].T
        crossed = (y0 > y) != (y1 > y)
        x = np.sort((x0 + (y - y0) / np.where(y1 == y0, 1, y1 - y0) * (x1 - x0))[crossed]).reshape(-1, 2)
        spans.append(x[x[:, 0] < 0.8 * foot.measures["foot_length"]])
    start, stop = np.concatenate(spans).T
    third = (stop.max() - start.min()) / 3
    low, high = start.min() + third, start.min() + 2 * third
    middle = np.clip(stop, low, high) - np.clip(start, low, high)
    assert middle.sum() / (stop - start).sum() == pytest.approx(foot.measures["arch_index"], abs=0.004)


def test_left_is_the_mirror_image(foot: Foot) -> None:
    left = make_foot(side="left")
    assert left.side == "left"
    np.testing.assert_array_equal(left.vertices * (1, -1, 1), foot.vertices)
    np.testing.assert_array_equal(left.faces[:, ::-1], foot.faces)
    assert left.measures == foot.measures
    assert left.landmarks["metatarsale_tibiale"][1] == -foot.landmarks["metatarsale_tibiale"][1]


def test_resolution_leaves_the_measures_alone(foot: Foot, mesh: trimesh.Trimesh) -> None:
    coarse = make_foot(resolution_mm=2.0)
    assert coarse.measures == foot.measures
    coarse_mesh = trimesh.Trimesh(coarse.vertices, coarse.faces, process=False)
    waist = ((1, 0, 0), (150.0, 0, 0))
    assert tape(coarse_mesh, *waist) == pytest.approx(tape(mesh, *waist), abs=0.15)
    assert coarse_mesh.volume == pytest.approx(mesh.volume, rel=2e-3)


def test_placed_foot_keeps_its_measures(foot: Foot) -> None:
    moved = placed(foot, 40.0, -7.0, 6.0)
    assert moved.measures == foot.measures
    tip = moved.landmarks["toe_2_tip"] - moved.landmarks["pternion"]
    assert np.degrees(np.arctan2(tip[1], tip[0])) == pytest.approx(6.0)
    assert moved.landmarks["pternion"][:2] == pytest.approx([40.0, -7.0])
    step = np.diff(foot.vertices[::500], axis=0)
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(moved.vertices[::500], axis=0), axis=1), np.linalg.norm(step, axis=1)
    )
    np.testing.assert_array_equal(moved.vertices[:, 2], foot.vertices[:, 2])


def test_quarter_turn_is_counter_clockwise_from_above(foot: Foot) -> None:
    moved = placed(foot, 1.0, 2.0, 90.0)
    assert moved.landmarks["toe_2_tip"][:2] == pytest.approx([1.0, 2.0 + foot.landmarks["toe_2_tip"][0]])


@pytest.mark.parametrize("seed", range(4))
def test_drawn_feet_have_their_measures(seed: int) -> None:
    shape = sample_shape(np.random.default_rng(seed), "female" if seed % 2 else "male")
    foot = make_foot(shape, resolution_mm=1.5)
    mesh = trimesh.Trimesh(foot.vertices, foot.faces, process=False)
    assert mesh.is_watertight
    for name in ("foot_length", "foot_breadth", "ball_girth", "instep_height", "arch_height"):
        assert foot.measures[name] == pytest.approx(getattr(shape, name), abs=0.1), name
    assert mesh.extents[0] == pytest.approx(shape.foot_length, abs=0.1)


def test_second_toe_can_be_the_longest() -> None:
    foot = make_foot(FootShape(toe_lengths=(0.985, 1.0, 0.96, 0.91, 0.86)), resolution_mm=2.0)
    assert foot.landmarks["toe_2_tip"][0] == foot.measures["foot_length"] == 262.0
    assert foot.landmarks["toe_1_tip"][0] == pytest.approx(0.985 * 262.0)


@pytest.mark.parametrize("change", [{"ball_girth": 150.0}, {"arch_height": 60.0}, {"instep_height": 20.0}])
def test_measures_that_no_foot_has_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(RefusedInput, match="foot shape"):
        make_foot(replace(FootShape(), **change), resolution_mm=2.0)
