import numpy as np
import pytest
import trimesh

from footscan.verify.distances import signed_distances
from footscan.verify.pseudonormals import sides

SPHERE = trimesh.creation.icosphere(subdivisions=3, radius=20.0)
VERTICES, FACES = np.asarray(SPHERE.vertices), np.asarray(SPHERE.faces, np.int32)


def around(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points within 5 mm of the sphere, and whether each is outside the polyhedron."""
    random = np.random.default_rng(0)
    points = VERTICES[random.integers(0, len(VERTICES), count)] * random.uniform(0.75, 1.25, (count, 1))
    points += random.normal(0, 1.0, points.shape)
    # A convex body: outside is what lies beyond the plane of any face.
    beyond = (points @ SPHERE.face_normals.T - np.sum(SPHERE.triangles[:, 0] * SPHERE.face_normals, axis=1)).max(axis=1)
    sure = np.abs(beyond) > 1e-4
    return points[sure], beyond[sure] > 0


def test_the_normals_of_a_cube_by_hand() -> None:
    cube = trimesh.creation.box(extents=(2, 2, 2))
    normals = sides((np.asarray(cube.vertices), np.asarray(cube.faces, np.int32)))
    # Three right angles meet at a corner, be they of one triangle or of two.
    np.testing.assert_allclose(normals.of_vertices, np.sign(normals.vertices) * np.pi / 2, atol=1e-12)
    middles = (normals.vertices[normals.faces[:, [1, 2, 0]]] + normals.vertices[normals.faces[:, [2, 0, 1]]]) / 2
    # Of an edge: the two faces' normals; a diagonal's middle is that of a face of the cube.
    diagonal = np.sum(np.abs(middles) > 0.5, axis=2) == 1
    np.testing.assert_allclose(normals.of_edges, np.where(diagonal[..., None], 2, 1) * middles, atol=1e-12)


@pytest.mark.parametrize("seen_from_inside", [False, True])
@pytest.mark.parametrize("kept", [1.0, 0.6, 0.3], ids=["closed", "open", "bowl"])
def test_the_side_is_right_wherever_the_mesh_is_there(kept: float, seen_from_inside: bool) -> None:
    points, outside = around(4000)
    highest = SPHERE.triangles_center[:, 2] < -20 + 40 * kept
    faces = FACES[highest][:, ::-1] if seen_from_inside else FACES[highest]
    whole, part = signed_distances(points, (VERTICES, FACES)), signed_distances(points, (VERTICES, faces))
    np.testing.assert_array_equal(whole > 0, outside)
    there = np.abs(np.abs(whole) - np.abs(part)) < 1e-6  # the place nearest to it was kept
    assert there.mean() > 0.8 * kept
    np.testing.assert_array_equal(part[there] > 0, outside[there])


def test_at_a_sharp_edge_the_normal_of_a_single_face_would_be_wrong() -> None:
    # A blade, two faces 5 degrees apart; above its edge along Y the nearer face may look away.
    half = np.deg2rad(2.5)
    low = [[-np.sin(half), y, -np.cos(half)] for y in (-1, 1)] + [[np.sin(half), y, -np.cos(half)] for y in (-1, 1)]
    vertices = np.array([[0, -1, 0], [0, 1, 0], *low], float) * 10
    blade = trimesh.convex.convex_hull(vertices)
    turns = np.linspace(-80, 80, 33)
    points = np.column_stack([np.sin(np.deg2rad(turns)), np.zeros(33), np.cos(np.deg2rad(turns))]) * 2
    distances = signed_distances(points, (np.asarray(blade.vertices), np.asarray(blade.faces, np.int32)))
    np.testing.assert_allclose(distances, 2, atol=1e-5)


def test_faces_turned_at_random_are_turned_alike() -> None:
    points, outside = around(2000)
    faces = FACES.copy()
    turned = np.random.default_rng(1).random(len(faces)) < 0.4
    faces[turned] = faces[turned][:, ::-1]
    np.testing.assert_array_equal(signed_distances(points, (VERTICES, faces)) > 0, outside)


def test_two_bodies_of_which_one_looks_inwards() -> None:
    # Consistent each for itself: then the mesh is taken at its word, the larger volume decides.
    shifted = VERTICES * 0.5 + [60.0, 0, 0]
    mesh = np.concatenate([VERTICES, shifted]), np.concatenate([FACES, FACES[:, ::-1] + len(VERTICES)])
    assert signed_distances(np.array([[0.0, 0, 0], [60.0, 0, 0]]), mesh) == pytest.approx([-20, 10], abs=0.4)


def test_a_sheet_keeps_the_side_that_it_was_given() -> None:
    vertices = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    points = np.array([[4.0, 6, 3], [5, 5, -2], [12, 5, 1]])
    expected = [3, -2, np.hypot(2, 1)]
    np.testing.assert_allclose(signed_distances(points, (vertices, faces)), expected, atol=1e-6)
    np.testing.assert_allclose(signed_distances(points, (vertices, faces[:, ::-1])), -np.array(expected), atol=1e-6)


def test_doubled_vertices_doubled_faces_and_faces_without_area_change_nothing() -> None:
    points, _ = around(1000)
    flat = np.array([[0, 0, 1], [5, 7, 7], [3, 4, 3]], np.int32)
    apart = VERTICES[FACES].reshape(-1, 3), np.arange(FACES.size, dtype=np.int32).reshape(-1, 3)
    spoiled = apart[0], np.concatenate([apart[1], apart[1][:200], apart[1][:100, [1, 2, 0]], flat])
    plain = signed_distances(points, (VERTICES, FACES))
    np.testing.assert_allclose(signed_distances(points, spoiled), plain, atol=1e-5)


def test_a_strip_with_one_side_is_no_crash() -> None:
    # A Moebius strip has no outside; its distances count all the same.
    turn = np.linspace(0, 2 * np.pi, 41)[:-1]
    rim = [
        np.column_stack(
            [
                (20 + s * np.cos(turn / 2)) * np.cos(turn),
                (20 + s * np.cos(turn / 2)) * np.sin(turn),
                s * np.sin(turn / 2),
            ]
        )
        for s in (-4, 4)
    ]
    a, b = np.arange(40), np.arange(40) + 40
    ahead_a, ahead_b = np.roll(a, -1), np.roll(b, -1)
    ahead_a[-1], ahead_b[-1] = 40, 0
    faces = np.concatenate([np.column_stack([a, ahead_a, b]), np.column_stack([ahead_a, ahead_b, b])]).astype(np.int32)
    distances = signed_distances(np.array([[0.0, 0, 0]]), (np.concatenate(rim), faces))
    assert abs(distances[0]) == pytest.approx(16, abs=0.2)
