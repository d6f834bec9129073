import numpy as np
import pytest
import trimesh

from footscan.mesh.mesh import Mesh
from footscan.surface.fidelity import fidelity


def box(length: float, breadth: float, height: float) -> Mesh:
    """With one corner at the origin."""
    made = trimesh.creation.box((length, breadth, height))
    middle = np.array([length, breadth, height]) / 2
    return Mesh(made.vertices + middle, np.asarray(made.faces, np.int32))


def test_two_boxes_of_which_one_is_higher() -> None:
    differences = fidelity(box(100, 40, 30), box(100, 40, 30.5))
    assert differences.surface_max == pytest.approx(0.5, abs=1e-5)
    # Of 2 (100 * 40 + 100 * 30 + 40 * 30) mm² the top, 4000, is 0.5 off and next to nothing else, corners aside.
    assert differences.surface_mean == pytest.approx(0.5 * 4000 / 16400, rel=0.05)
    assert differences.extremes == pytest.approx(0.5)
    assert differences.girths == pytest.approx(1.0)  # 2 (40 + 30.5) - 2 (40 + 30)
    assert not differences.kept


def test_a_mesh_and_itself() -> None:
    differences = fidelity(box(100, 40, 30), box(100, 40, 30))
    assert max(differences) < 1e-4  # single precision
    assert differences.kept
    assert fidelity(box(100, 40, 30), box(100.04, 40, 30.04)).kept
    assert not fidelity(box(100, 40, 30), box(100.06, 40, 30)).kept
    assert not fidelity(box(100, 40, 30), box(100, 40.03, 30.03)).kept
