import numpy as np
import pytest
import trimesh

from footscan.mesh.sampling import sample_surface
from footscan.verify.ambiguity import evidence, patches_of, stiffness
from footscan.verify.icp import Poses
from footscan.verify.nearest import MeshSurface

STAY = Poses(np.eye(3)[None], np.zeros((1, 3)))


def shape(mesh: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    return np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int32)


def test_a_cube_by_hand() -> None:
    cube = shape(trimesh.creation.box(extents=(50, 50, 50)))
    held, way = stiffness(STAY, sample_surface(*cube, 40_000), MeshSurface(cube), 1.0)
    # A shift is felt by the two faces of six across it: 1/3. A turn around z is felt on the four upright faces as the
    # square of y or x, a²/12 in the mean; on all six a²/18; in units of the mean square radius 5a²/12 that is 2/15.
    assert held == pytest.approx(2 / 15, rel=0.02)
    assert np.linalg.norm(way[:3]) > 0.95


def test_a_sphere_turns_on_itself_and_a_tube_slides() -> None:
    sphere = shape(trimesh.creation.icosphere(4, 50))
    held, way = stiffness(STAY, sample_surface(*sphere, 10_000), MeshSurface(sphere), 1.0)
    assert held < 0.001
    assert np.linalg.norm(way[:3]) > 0.99
    tube = trimesh.creation.cylinder(30, 200, sections=64)
    open_tube = (np.asarray(tube.vertices), np.asarray(tube.faces, np.int32)[np.abs(tube.face_normals[:, 2]) < 0.5])
    held, _ = stiffness(STAY, sample_surface(*open_tube, 10_000), MeshSurface(open_tube), 1.0)
    assert held < 0.001


def test_evidence_by_hand() -> None:
    patches = np.repeat(np.arange(16), 10)
    assert evidence(np.zeros(160), np.ones(160), patches) == pytest.approx(4.0)  # 16 patches agree: the root of 16
    sign = np.where(patches % 2 == 0, 1.0, -1.0)
    assert evidence(np.zeros(160), sign, patches) == pytest.approx(0.0)
    alone = (patches == 3).astype(float)
    assert evidence(np.zeros(160), alone, patches) == pytest.approx(1.0)  # one patch may be wrong by chance
    assert evidence(np.ones(160), np.ones(160), patches) == 0.0


def test_near_points_share_a_patch() -> None:
    points = np.array([[0.0, 0, 0], [0.1, 0, 0], [50, 0, 0], [100, 0, 0]])
    numbers = patches_of(points)
    assert numbers[0] == numbers[1]
    assert len(set(numbers.tolist())) == 3
