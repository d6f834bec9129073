import numpy as np

from footscan.mesh.cells import cell_means, group_by_cell


def test_points_of_one_cell_come_together_and_keep_their_order() -> None:
    points = np.array([[0.1, 0.1], [5.0, 0.0], [0.9, 0.2], [-0.1, 0.0]])
    order, starts = group_by_cell(points, np.array([1.0, 1.0]))
    groups = [order[a:b].tolist() for a, b in zip(starts, [*starts[1:], len(order)], strict=True)]
    assert groups == [[3], [0, 2], [1]]


def test_means_are_weighted() -> None:
    order, starts = group_by_cell(np.array([[0.2], [0.6], [1.5]]), np.array([1.0]))
    means = cell_means(np.array([[10.0], [20.0], [7.0]]), order, starts, np.array([3.0, 1.0, 2.0]))
    np.testing.assert_allclose(means, [[12.5], [7.0]])


def test_nothing_has_no_cells() -> None:
    order, starts = group_by_cell(np.zeros((0, 2)), np.ones(2))
    assert order.size == starts.size == 0
