import numpy as np
import trimesh

from footscan.surface.quality import mesh_quality
from schemas.quality import MeshQuality


def test_a_closed_box() -> None:
    box = trimesh.creation.box()
    assert mesh_quality(box.vertices, np.asarray(box.faces)) == MeshQuality(
        vertices=8, triangles=12, open_edges=0, non_manifold_edges=0, components=1, holes=0
    )


def test_a_hole_a_fin_and_a_stray() -> None:
    box = trimesh.creation.box()
    faces = np.asarray(box.faces)
    a, b, _ = faces[5]
    faces = np.concatenate([faces[1:], [[a, b, 8], [9, 10, 11]]])
    quality = mesh_quality(np.zeros((12, 3)), faces)
    assert (quality.triangles, quality.components) == (13, 2)
    assert quality.non_manifold_edges == 1
    # Three around the missing face, two of the fin, three of the stray.
    assert quality.open_edges == 8


def test_an_empty_mesh() -> None:
    assert mesh_quality(np.zeros((0, 3)), np.zeros((0, 3), np.int32)).triangles == 0
