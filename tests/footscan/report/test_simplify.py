import numpy as np

from footscan.report.simplify import simplify


def plane(cells):
    """A square of 1 mm cells in Z = 0.5, two triangles each."""
    row, column = np.divmod(np.arange((cells + 1) ** 2), cells + 1)
    vertices = np.column_stack([column, row, np.full(len(row), 0.5)]).astype(float)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    right, up = corner + 1, corner + cells + 1
    return vertices, np.concatenate([np.column_stack([corner, right, up]), np.column_stack([right, up + 1, up])])


def test_a_small_mesh_keeps_its_triangles_and_drops_what_they_do_not_use():
    vertices = np.array([[9, 9, 9], [0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    kept, faces, values = simplify(vertices, np.array([[1, 2, 3]]), np.array([[7.0], [1.0], [2.0], [3.0]]), 1)
    assert kept.tolist() == vertices[1:].tolist()
    assert faces.tolist() == [[0, 1, 2]]
    assert values.tolist() == [[1], [2], [3]]


def test_a_large_mesh_gets_smaller_and_stays_where_it_was():
    vertices, faces = plane(40)
    kept, fewer, values = simplify(vertices, faces, vertices[:, :1] * 2, 200)
    assert 100 < len(fewer) <= 200
    np.testing.assert_allclose(kept[:, 2], 0.5)
    np.testing.assert_allclose(values[:, 0], kept[:, 0] * 2)
    corners = kept[fewer]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normal[:, 2] > 0).all()
    # 40 x 40 mm, less what averaging takes from the margins: half a cell of some 5 mm on each side at most.
    assert 35**2 < normal[:, 2].sum() / 2 <= 40**2


def test_vertices_of_one_cell_become_their_mean():
    # Of an area of 0.5 mm², 1 triangle: cells of 1 mm; the first two vertices share one, so the small triangle goes.
    vertices = np.array([[0.1, 0.1, 0], [0.3, 0.1, 0], [1.5, 0.2, 0], [0.2, 1.5, 0]])
    kept, faces, _ = simplify(vertices, np.array([[0, 2, 3], [0, 1, 2]]), np.zeros((4, 1)), 1)
    assert len(faces) == 1
    np.testing.assert_allclose(sorted(kept.tolist()), sorted([[0.2, 0.1, 0], [1.5, 0.2, 0], [0.2, 1.5, 0]]))
