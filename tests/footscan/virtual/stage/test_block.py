import numpy as np
import trimesh

from footscan.virtual.stage.block import make_block


def test_block_stands_on_the_floor_with_known_size() -> None:
    vertices, faces = make_block()
    np.testing.assert_array_equal(vertices.min(axis=0), [0.0, -50.0, 0.0])
    np.testing.assert_array_equal(vertices.max(axis=0), [150.0, 50.0, 50.0])
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == 150.0 * 100.0 * 50.0  # positive: outward
    assert mesh.area == 2 * (150.0 * 100.0 + 150.0 * 50.0 + 100.0 * 50.0)
