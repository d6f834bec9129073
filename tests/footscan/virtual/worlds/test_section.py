"""Cuts of closed meshes."""

import numpy as np
import pytest
import trimesh

from footscan.virtual.optics.scene import Mesh
from footscan.virtual.worlds.section import SPACING_MM, Cut, CutMesh

RADIUS = 40.0


def ball() -> Mesh:
    sphere = trimesh.creation.icosphere(5, RADIUS)
    return Mesh(np.asarray(sphere.vertices), np.asarray(sphere.faces, np.int64))


def cut_where(mesh: Mesh, distance: np.ndarray) -> Cut:
    """The cut among all edges."""
    cut_mesh = CutMesh(mesh)
    return cut_mesh.cut(distance, cut_mesh.edges_within(-np.inf, np.inf))


@pytest.mark.parametrize("height", [-30.0, 0.3, 25.0])
def test_a_plane_cuts_a_ball_in_a_circle(height: float) -> None:
    mesh = ball()
    cut = cut_where(mesh, mesh.vertices[:, 2] - height)
    radius = np.sqrt(RADIUS**2 - height**2)
    assert cut.points[:, 2] == pytest.approx(np.full(len(cut.points), height), abs=1e-9)
    assert np.linalg.norm(cut.points[:, :2], axis=1) == pytest.approx(np.full(len(cut.points), radius), rel=2e-3)
    assert cut.normals == pytest.approx(cut.points / RADIUS, abs=0.03)
    assert len(cut.points) * SPACING_MM == pytest.approx(2.0 * np.pi * radius, rel=0.01)


def test_points_follow_each_other_along_the_line() -> None:
    mesh = ball()
    cut = cut_where(mesh, mesh.vertices[:, 0])
    gaps = np.linalg.norm(np.diff(cut.points, axis=0), axis=1)
    assert gaps == pytest.approx(np.full(len(gaps), SPACING_MM), rel=0.02)


def test_two_parts_are_two_lines() -> None:
    one, other = ball(), ball()
    both = Mesh(
        np.concatenate([one.vertices, other.vertices + np.array([200.0, 0.0, 0.0])]),
        np.concatenate([one.faces, other.faces + len(one.vertices)]),
    )
    cut = cut_where(both, both.vertices[:, 2] - 5.0)
    gaps = np.linalg.norm(np.diff(cut.points, axis=0), axis=1)
    assert np.count_nonzero(gaps > 1.0) == 1


def test_a_plane_beside_the_mesh_cuts_nothing() -> None:
    mesh = ball()
    assert len(cut_where(mesh, mesh.vertices[:, 2] - 50.0).points) == 0


def test_an_open_mesh_is_refused() -> None:
    mesh = ball()
    with pytest.raises(ValueError, match="closed"):
        CutMesh(Mesh(mesh.vertices, mesh.faces[1:]))


@pytest.mark.parametrize("x", [-39.9, 0.0, 17.3])
def test_the_edges_within_a_range_are_all_that_a_plane_there_cuts(x: float) -> None:
    mesh = ball()
    cut_mesh, distance = CutMesh(mesh), mesh.vertices[:, 0] - x
    near = cut_mesh.edges_within(x, x)
    assert len(near) < 0.1 * len(cut_mesh.edges_within(-np.inf, np.inf))
    np.testing.assert_array_equal(cut_mesh.cut(distance, near).points, cut_where(mesh, distance).points)
