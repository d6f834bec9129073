import numpy as np

from footscan.mesh.voxels import BORDER, EMPTY, MOST_CELLS, voxelise


def test_points_by_cells() -> None:
    voxels = voxelise(np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.4, 0.2, 0.3], [0.0, 0.0, 5.0]]), (2.0, 1.0, 1.0))
    assert voxels.voxel.tolist() == [0, 2, 2, 1]
    np.testing.assert_array_equal(voxels.place - BORDER, [[0, 0, 0], [0, 0, 5], [1, 0, 0]])
    assert (voxels.number != EMPTY).sum() == 3
    assert voxels.number[tuple(voxels.place.T)].tolist() == [0, 1, 2]


def test_planes_one_cell_apart_have_cells_of_their_own() -> None:
    x = (0.1 + 2.1 * np.arange(200)).astype(np.float32).astype(np.float64)
    voxels = voxelise(np.column_stack([x, 0 * x, 0 * x]), (2.1, 1.0, 1.0))
    assert voxels.voxel.tolist() == list(range(200))


def test_the_border_is_empty_on_all_sides() -> None:
    number = voxelise(np.random.default_rng(1).uniform(-7, 7, (500, 3)), (1.0, 1.0, 1.0)).number
    for axis in range(3):
        for side in (slice(None, BORDER), slice(-BORDER, None)):
            assert (np.moveaxis(number, axis, 0)[side] == EMPTY).all()


def test_a_wide_cloud_has_larger_cells() -> None:
    voxels = voxelise(np.array([[0.0, 0.0, 0.0], [1e4, 1e4, 1e4]]), (1.0, 1.0, 1.0))
    assert voxels.number.size <= MOST_CELLS
    assert voxels.voxel.tolist() == [0, 1]
