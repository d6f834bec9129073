import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from footscan.mesh.formats.files import read_mesh
from footscan.mesh.mesh import Mesh, signed_volume
from footscan.surface.collapse import collapse_edges
from footscan.surface.decimate import decimate, outermost
from footscan.surface.fidelity import fidelity
from footscan.surface.quality import mesh_quality
from footscan.virtual.foot.foot import make_foot

PRESETS = (40_000, 20_000)
"""Triangles that CAD programs for orthopaedics want at most, of feet and of insoles."""
DATA = os.environ.get("FOOTSCAN_DATA")


@pytest.fixture(scope="module")
def foot() -> Mesh:
    made = make_foot()
    x, _, z = made.vertices.T
    colours = np.column_stack([x / 2, z, np.full(len(x), 77)]).astype(np.uint8)
    filled = z > 107.9
    return Mesh(
        made.vertices,
        made.faces,
        colours=colours,
        camera=np.where(filled, 0, 1 + x // 40).astype(np.uint8),
        filled=filled,
        metadata={"side": "right"},
    )


@pytest.fixture(scope="module")
def smaller(foot: Mesh) -> dict[int, Mesh]:
    return {triangles: decimate(foot, triangles) for triangles in PRESETS}


def counts(mesh: Mesh) -> tuple[int, int, int]:
    quality = mesh_quality(mesh.vertices, mesh.faces)
    return quality.open_edges, quality.non_manifold_edges, quality.components


def plain(mesh: trimesh.Trimesh) -> Mesh:
    return Mesh(np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int32))


def collapsed(mesh: Mesh, triangles: int) -> Mesh:
    nothing = np.zeros(len(mesh.vertices), np.bool_)
    vertices, faces, _, _ = collapse_edges(
        mesh.vertices, mesh.faces, np.zeros((len(mesh.vertices), 0)), nothing, triangles
    )
    return Mesh(vertices, faces)


@pytest.mark.parametrize("triangles", PRESETS)
def test_the_virtual_foot_keeps_its_measures(foot: Mesh, smaller: dict[int, Mesh], triangles: int) -> None:
    decimated = smaller[triangles]
    assert len(decimated.faces) in (triangles, triangles - 1)
    assert counts(decimated) == (0, 0, 1)
    assert signed_volume(decimated) == pytest.approx(signed_volume(foot), rel=2e-4)
    # Ends as they were: what is outermost does not move, and nothing goes beyond.
    for end in (np.min, np.max):
        np.testing.assert_allclose(end(decimated.vertices, axis=0), end(foot.vertices, axis=0), atol=0.01)
    assert decimated.vertices[:, 2].min() == foot.vertices[:, 2].min()
    changed = fidelity(foot, decimated)
    assert changed.kept  # 0.05 and 0.1 mm
    assert changed.surface_max < 0.15
    assert changed.surface_mean < 0.01

    # What is known of a vertex is that of the skin there.
    nearby = decimated.vertices[~decimated.filled]
    np.testing.assert_allclose(decimated.colours[~decimated.filled, 0], nearby[:, 0] / 2, atol=3)
    assert set(decimated.colours[:, 2]) == {77}
    assert np.abs(decimated.camera[~decimated.filled] - (1 + nearby[:, 0] / 40) + 0.5).max() < 0.7
    assert np.all(decimated.vertices[decimated.filled, 2] > 105)
    assert decimated.metadata == foot.metadata


def test_every_run_gives_the_same_bytes(foot: Mesh, smaller: dict[int, Mesh]) -> None:
    first, second = smaller[20_000], decimate(foot, 20_000)
    assert first.vertices.tobytes() == second.vertices.tobytes()
    assert first.faces.tobytes() == second.faces.tobytes()


def test_a_mesh_with_fewer_triangles_stays_as_it_is(foot: Mesh) -> None:
    assert decimate(foot, len(foot.faces)) is foot


@pytest.mark.skipif(DATA is None, reason="FOOTSCAN_DATA is not set")
def test_a_foot_of_another_maker() -> None:
    vertices, faces = read_mesh(Path(DATA or "") / "find" / "template.obj")
    scale = 265 / np.ptp(vertices, axis=0).max()
    for _ in range(3):
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    template = Mesh(np.asarray(vertices) * scale, np.asarray(faces, np.int32))
    decimated = decimate(template, 20_000)
    assert len(decimated.faces) in (20_000, 19_999)
    assert counts(decimated)[:2] == counts(Mesh(*read_mesh(Path(DATA or "") / "find" / "template.obj")))[:2]
    assert fidelity(template, decimated).kept


def test_a_cube_keeps_its_corners() -> None:
    cube = trimesh.creation.box((10.0, 20.0, 30.0))
    fine = cube.subdivide().subdivide().subdivide()
    assert len(fine.faces) == 12 * 4**3
    decimated = collapsed(plain(fine), 60)
    assert len(decimated.faces) == 60
    for corner in cube.vertices:
        assert np.linalg.norm(decimated.vertices - corner, axis=1).min() < 1e-3
    assert signed_volume(decimated) == pytest.approx(6000, rel=1e-5)


def test_holes_through_a_body_stay() -> None:
    """A ring of as few triangles as can be is still one: V - E + F = 0."""
    decimated = collapsed(plain(trimesh.creation.torus(30.0, 10.0)), 4)
    assert counts(decimated) == (0, 0, 1)
    assert len(decimated.vertices) - 3 * len(decimated.faces) // 2 + len(decimated.faces) == 0
    assert 14 <= len(decimated.faces) < 40  # no ring has fewer than 14 (Möbius 1861)


def test_a_tetrahedron_and_a_triangle_are_the_end() -> None:
    vertices = np.array([[0.0, 0, 0], [10, 0, 0], [0, 20, 0], [0, 0, 30]])
    body = Mesh(vertices, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], np.int32))
    assert len(collapsed(body, 1).faces) == 4
    assert len(collapsed(Mesh(vertices[:3], body.faces[:1]), 0).faces) == 1


def test_open_rims_stay_where_they_are() -> None:
    """Of a pipe of radius 50 mm and 60 mm length, with 96 vertices around and 21 along."""
    around, along = np.meshgrid(np.arange(96), np.arange(21))
    angle = around.ravel() * 2 * np.pi / 96
    vertices = np.column_stack([50 * np.cos(angle), 50 * np.sin(angle), along.ravel() * 3.0])
    a, b = (along * 96 + around)[:-1].ravel(), (along * 96 + (around + 1) % 96)[:-1].ravel()
    faces = np.concatenate([np.column_stack([a, b, b + 96]), np.column_stack([a, b + 96, a + 96])]).astype(np.int32)
    decimated = collapsed(Mesh(vertices, faces), 400)
    quality = mesh_quality(decimated.vertices, decimated.faces)
    assert quality.triangles in (399, 400)
    assert (quality.holes, quality.non_manifold_edges, quality.components) == (2, 0, 1)
    for height in (0, 60):
        rim = decimated.vertices[np.abs(decimated.vertices[:, 2] - height) < 0.01]
        assert len(rim) > 20
    assert np.sum((decimated.vertices[:, 2] < 0.01) | (decimated.vertices[:, 2] > 59.99)) == quality.open_edges
    np.testing.assert_allclose(np.hypot(decimated.vertices[:, 0], decimated.vertices[:, 1]), 50, atol=0.2)


def test_outermost_vertices_stay_to_the_last_digit(foot: Mesh, smaller: dict[int, Mesh]) -> None:
    chosen = outermost(foot.vertices, np.arange(len(foot.vertices)))
    assert 150 < len(chosen) < 220  # four in each of 53 slabs, fewer where one is outermost twice
    kept = {place.tobytes() for place in smaller[20_000].vertices}
    assert all(place.tobytes() in kept for place in foot.vertices[chosen])


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(3, 12), st.integers(1, 60), st.integers(0, 40))
def test_no_mesh_is_too_bad(seed: int, vertices: int, faces: int, triangles: int) -> None:
    """Triangles at random, many at one edge, some without area."""
    random = np.random.default_rng(seed)
    corners = np.array([random.permutation(vertices)[:3] for _ in range(faces)], np.int32)
    mesh = Mesh(random.integers(0, 3, (vertices, 3)).astype(np.float64), corners)
    decimated = collapsed(mesh, triangles)
    assert len(decimated.faces) <= len(mesh.faces)
    assert np.all(np.isfinite(decimated.vertices))
    assert decimated.faces.size == 0 or decimated.faces.max() < len(decimated.vertices)
    assert all(len(set(face)) == 3 for face in decimated.faces.tolist())
