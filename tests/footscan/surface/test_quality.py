import numpy as np
import pytest
import trimesh

from footscan.surface.quality import mesh_quality


def test_a_closed_box() -> None:
    box = trimesh.creation.box()
    half = np.sqrt(3.0) / 2  # 4 sqrt(3) * 0.5 / (1 + 1 + 2), of half a square
    quality = mesh_quality(box.vertices, np.asarray(box.faces))
    assert (quality.triangle_quality, quality.worst_triangles) == (pytest.approx(half), pytest.approx(half))
    assert quality.model_dump(exclude={"triangle_quality", "worst_triangles"}, exclude_defaults=True) == {
        "vertices": 8, "triangles": 12, "open_edges": 0, "non_manifold_edges": 0, "components": 1, "holes": 0
    }  # fmt: skip


def test_shares_of_the_area() -> None:
    box = trimesh.creation.box()
    top = box.vertices[:, 2] == 0.5
    quality = mesh_quality(box.vertices, np.asarray(box.faces), filled=top, cut_mm=0.5)
    assert quality.cut_share == pytest.approx(1 / 6)
    assert quality.filled_share == pytest.approx(4 / 6)  # each triangle of the sides has a corner at the top
    assert mesh_quality(box.vertices, np.asarray(box.faces)[1:]).largest_hole_mm == pytest.approx(2 + np.sqrt(2))


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
