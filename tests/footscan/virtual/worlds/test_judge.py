"""Distances from the truth of a world."""

import numpy as np
import pytest
import trimesh

from footscan.virtual.optics.scene import Mesh
from footscan.virtual.worlds.judge import Truth


@pytest.fixture(scope="module")
def box() -> Mesh:
    """100 x 60 x 40 mm, its lower face at Z = 0."""
    solid = trimesh.creation.box((100.0, 60.0, 40.0)).subdivide().subdivide().subdivide()
    return Mesh(np.asarray(solid.vertices) + np.array([0.0, 0.0, 20.0]), np.asarray(solid.faces, np.int64))


def surface_points(box: Mesh, count: int = 3000) -> np.ndarray:
    solid = trimesh.Trimesh(box.vertices, box.faces, process=False)
    return np.asarray(trimesh.sample.sample_surface(solid, count, seed=1)[0])


def test_distances_are_those_to_the_surface(box: Mesh) -> None:
    points = np.array([[0.0, 0.0, 41.5], [52.0, 0.0, 20.0], [0.0, 0.0, 20.0]])
    assert Truth(box).distances(points) == pytest.approx([1.5, 2.0, 20.0], abs=1e-4)


def test_a_moved_scan_is_brought_back(box: Mesh) -> None:
    points = surface_points(box)
    angle = np.radians(1.0)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    moved = points @ turn.T + [2.0, -1.0, 0.5]
    back, shift = Truth(box).registered(moved)
    assert Truth(box).distances(moved @ back.T + shift).max() < 0.05


def test_a_lump_does_not_pull_the_rest(box: Mesh) -> None:
    points = surface_points(box)
    points[:300] += [0.0, 0.0, 30.0]
    turn, shift = Truth(box).registered(points)
    assert Truth(box).distances(points[300:] @ turn.T + shift).max() < 0.05


def test_coverage_is_the_share_of_the_surface_with_points(box: Mesh) -> None:
    points = surface_points(box)
    truth = Truth(box)
    assert truth.covered(points) == 1.0
    assert truth.covered(points[points[:, 0] < 0.0]) == pytest.approx(0.55, abs=0.06)
    assert truth.covered(points[:0]) == 0.0
