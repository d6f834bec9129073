import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from footscan.mesh.sections import Loop, cut, cuttable

ALONG = np.array([1.0, 0.0, 0.0])
Mesh = tuple[np.ndarray, np.ndarray]


def cylinder(sections: int = 360) -> Mesh:
    """Radius 40 mm, axis along X from -50 to 50."""
    mesh = trimesh.creation.cylinder(radius=40.0, height=100.0, sections=sections)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    return np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces)


def length(loop: Loop) -> float:
    return float(np.linalg.norm(loop.points - np.roll(loop.points, -1, axis=0), axis=1).sum())


def test_one_loop_around_a_cylinder() -> None:
    (loop,) = cut(cuttable(*cylinder()), np.array([3.0, 0, 0]), ALONG)
    assert loop.gap == 0.0
    np.testing.assert_allclose(loop.points[:, 0], 3.0)
    assert length(loop) == pytest.approx(2 * np.pi * 40, rel=1e-4)
    # In order: neighbours are closer than a facet is wide, and go around once.
    angle = np.unwrap(np.arctan2(loop.points[:, 2], loop.points[:, 1]))
    assert abs(angle[-1] - angle[0]) == pytest.approx(2 * np.pi, abs=0.02)
    assert np.abs(np.diff(angle)).max() < 0.02


def test_every_point_lies_on_its_edge() -> None:
    vertices, faces = cylinder(24)
    normal = np.array([0.8, 0.6, 0.0])
    (loop,) = cut(cuttable(vertices, faces), np.zeros(3), normal)
    first, second = vertices[loop.edges[:, 0]], vertices[loop.edges[:, 1]]
    np.testing.assert_allclose(loop.points, first + loop.shares[:, None] * (second - first))
    np.testing.assert_allclose(loop.points @ normal, 0.0, atol=1e-12)


def test_a_plane_that_misses() -> None:
    assert cut(cuttable(*cylinder()), np.array([80.0, 0, 0]), ALONG) == []


def test_a_plane_through_vertices_closes_too() -> None:
    box = trimesh.creation.box(extents=(10, 20, 30)).subdivide()
    (loop,) = cut(cuttable(np.asarray(box.vertices), np.asarray(box.faces)), np.zeros(3), ALONG)
    assert loop.gap == 0.0
    assert length(loop) == pytest.approx(100.0)


def test_two_bodies_are_two_loops() -> None:
    boxes = [trimesh.creation.box(extents=(10, 4, 6), transform=shift(y)) for y in (0.0, 20.0)]
    both = trimesh.util.concatenate(boxes)
    loops = cut(cuttable(np.asarray(both.vertices), np.asarray(both.faces)), np.array([1.0, 0, 0]), ALONG)
    assert sorted(length(loop) for loop in loops) == pytest.approx([20.0, 20.0])


def shift(y: float) -> np.ndarray:
    transform = np.eye(4)
    transform[1, 3] = y
    return transform


def test_an_opening_is_run_over_straight_and_told() -> None:
    vertices, faces = cylinder()
    middle = vertices[faces].mean(axis=1)
    opened = (np.abs(middle[:, 1]) < 10) & (middle[:, 2] > 0)
    (loop,) = cut(cuttable(vertices, faces[~opened]), np.zeros(3), ALONG)
    # Facets are 0.7 mm wide: the opening is 20 mm and up to two facets more or less.
    assert loop.gap == pytest.approx(20.0, abs=1.5)
    half = np.arcsin(loop.gap / 80)
    assert length(loop) == pytest.approx(80 * (np.pi - half) + loop.gap, abs=0.05)


def test_pieces_are_joined_end_to_end() -> None:
    vertices, faces = cylinder()
    middle = vertices[faces].mean(axis=1)
    opened = (np.abs(middle[:, 1]) < 2) | (np.abs(middle[:, 2]) < 2)  # four slits, some 4 mm wide
    (loop,) = cut(cuttable(vertices, faces[~opened]), np.zeros(3), ALONG)
    assert loop.gap == pytest.approx(4.0, abs=1.5)
    assert length(loop) == pytest.approx(2 * np.pi * 40, abs=0.1)


def test_more_than_two_faces_at_an_edge_do_no_harm() -> None:
    box = trimesh.creation.box(extents=(10, 20, 30))
    vertices, faces = np.asarray(box.vertices), np.asarray(box.faces)
    doubled = np.concatenate([faces, faces[:3]])
    loops = cut(cuttable(vertices, doubled), np.zeros(3), ALONG)
    points = np.concatenate([loop.points for loop in loops])
    assert ConvexHull(points[:, 1:]).area == pytest.approx(100.0)


def test_an_empty_mesh() -> None:
    assert cut(cuttable(np.zeros((0, 3)), np.zeros((0, 3), np.int64)), np.zeros(3), ALONG) == []
