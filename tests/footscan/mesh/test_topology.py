import numpy as np

from footscan.mesh.topology import drop_tangles, edge_counts, face_components, keep_large_components, used_vertices

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], np.int32)


def test_every_edge_of_a_closed_mesh_has_two_faces() -> None:
    edges, counts = edge_counts(TETRAHEDRON)
    assert edges.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
    assert counts.tolist() == [2] * 6


def test_components_are_told_apart_and_small_ones_dropped() -> None:
    faces = np.concatenate([TETRAHEDRON, [[10, 11, 12]]])
    assert face_components(faces).tolist() == [0, 0, 0, 0, 1]
    np.testing.assert_array_equal(keep_large_components(faces, 0.3), TETRAHEDRON)
    np.testing.assert_array_equal(keep_large_components(faces, 0.2), faces)
    assert keep_large_components(np.zeros((0, 3), np.int32), 0.5).shape == (0, 3)


def test_a_fin_on_a_closed_mesh_is_a_tangle() -> None:
    fin = np.concatenate([TETRAHEDRON, [[0, 1, 4]]])
    # The edge 0-1 has three faces; two of the tetrahedron's go with the fin.
    assert drop_tangles(fin).tolist() == [[1, 2, 3], [2, 0, 3]]


def test_neighbours_that_run_the_same_way_are_a_tangle() -> None:
    assert drop_tangles(np.array([[0, 1, 2], [0, 1, 3], [5, 6, 7]])).tolist() == [[5, 6, 7]]


def test_used_vertices_are_renumbered() -> None:
    vertices, faces = used_vertices(np.arange(15.0).reshape(5, 3), np.array([[4, 1, 3]]))
    assert vertices[:, 0].tolist() == [3.0, 9.0, 12.0]
    assert faces.tolist() == [[2, 0, 1]]
