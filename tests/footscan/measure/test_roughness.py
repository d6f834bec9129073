import numpy as np
import pytest
import trimesh

from footscan.measure.roughness import Roughness, roughness
from footscan.mesh.topology import vertex_normals


def rough_sphere(noise: float) -> Roughness:
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=50.0)
    vertices, faces = np.array(mesh.vertices), np.asarray(mesh.faces)
    vertices *= 1 + np.random.default_rng(0).normal(0, noise / 50, (len(vertices), 1))
    return roughness(vertices, vertex_normals(vertices, faces), faces)


@pytest.mark.parametrize("noise", [0.05, 0.1, 0.3])
def test_noise_is_told(noise: float) -> None:
    estimate = rough_sphere(noise).noise
    assert np.median(estimate) == pytest.approx(noise, rel=0.1)
    assert np.quantile(estimate, [0.01, 0.99]) == pytest.approx([noise, noise], rel=0.5)


def test_a_smooth_surface_has_none() -> None:
    assert rough_sphere(0.0).deviation.max() < 0.002


def test_coarse_triangles_are_rough_without_noise() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=50.0)  # edges of 7 mm, on a form with waves of 60 mm
    vertices, faces = np.array(mesh.vertices), np.asarray(mesh.faces)
    vertices *= 1 + 0.05 * np.sin(vertices.sum(axis=1, keepdims=True) / 10)
    coarse = roughness(vertices, vertex_normals(vertices, faces), faces)
    assert np.median(coarse.deviation) > 0.05
    assert np.median(coarse.noise) < 0.3 * np.median(coarse.deviation)


def test_a_sharp_edge_is_noise_only_to_its_neighbours() -> None:
    mesh = trimesh.creation.box(extents=(40, 40, 40))
    for _ in range(4):
        mesh = mesh.subdivide()  # edges of 2.5 mm
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    estimate = roughness(vertices, vertex_normals(vertices, faces), faces).deviation
    inner = np.sort(np.abs(vertices), axis=1)[:, 1] < 20 - 4 * 2.5
    assert np.count_nonzero(inner) > 100
    np.testing.assert_allclose(estimate[inner], 0.0, atol=1e-6)


def test_a_mesh_too_small_to_tell() -> None:
    mesh = trimesh.creation.box(extents=(1, 1, 1))
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    assert not roughness(vertices, vertex_normals(vertices, faces), faces).deviation.any()
