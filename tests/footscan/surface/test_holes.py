import numpy as np
import pytest
import trimesh

from footscan.mesh.topology import edge_counts
from footscan.surface.holes import close_holes, rims


def sphere_without_cap(radius: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """A sphere of about 1.5 mm edges whose part above `height` (of Z) is missing."""
    sphere = trimesh.creation.uv_sphere(radius=radius, count=[round(2 * radius), round(4 * radius)])
    faces = sphere.faces[(sphere.vertices[sphere.faces][:, :, 2] <= height).all(axis=1)]
    return np.asarray(sphere.vertices, np.float64), np.asarray(faces, np.int32)


def test_the_rim_of_a_hole_runs_as_its_cover_must() -> None:
    # A square pyramid without its base 0-1-2-3.
    faces = np.array([[1, 0, 4], [2, 1, 4], [3, 2, 4], [0, 3, 4]])
    assert rims(faces) == [[0, 1, 2, 3]]


def test_holes_that_touch_at_a_vertex_are_two() -> None:
    around = trimesh.creation.box().subdivide()
    missing = [f for f, face in enumerate(around.faces) if f in (0, 1)]
    assert len(rims(np.delete(around.faces, missing, axis=0))) >= 1
    bow_tie = np.array([[0, 1, 2], [0, 3, 4]])
    assert sorted(map(len, rims(bow_tie))) == [3, 3]


def test_a_closed_mesh_has_no_rim() -> None:
    assert rims(np.asarray(trimesh.creation.icosphere(subdivisions=2).faces)) == []


@pytest.mark.parametrize("radius", [10.0, 30.0])
def test_a_sphere_gets_its_cap_back(radius: float) -> None:
    rim_height = radius - 2.0
    vertices, faces = close_holes(*sphere_without_cap(radius, rim_height), 190.0, 0.0, 1.5)
    _, counts = edge_counts(faces)
    assert set(counts.tolist()) == {2}
    deviation = np.abs(np.linalg.norm(vertices[np.unique(faces)], axis=1) - radius)
    # A flat lid would be off by up to 2 mm and more.
    assert deviation.max() < 0.4
    assert trimesh.Trimesh(vertices, faces).is_winding_consistent


def test_large_openings_stay() -> None:
    vertices, faces = sphere_without_cap(30.0, 5.0)
    assert close_holes(vertices, faces, 150.0, 0.0, 1.5)[1].tolist() == faces.tolist()


def cylinder_with_slit(width: float) -> tuple[np.ndarray, np.ndarray]:
    """An open upright cylinder of 35 mm radius and 80 mm height, with a slit 60 mm deep in its upper rim."""
    angles, z = np.meshgrid(np.linspace(0, 2 * np.pi, 220, endpoint=False), np.linspace(0, 80, 81), indexing="ij")
    vertices = np.column_stack([35 * np.cos(angles.ravel()), 35 * np.sin(angles.ravel()), z.ravel()])
    number = np.arange(220 * 81).reshape(220, 81)
    a, b = number[:, :-1].ravel(), np.roll(number, -1, axis=0)[:, :-1].ravel()
    faces = np.concatenate([np.column_stack([a, b, b + 1]), np.column_stack([a, b + 1, a + 1])])
    middle = vertices[faces].mean(axis=1)
    slit = (middle[:, 0] < 0) & (np.abs(middle[:, 1]) < width / 2) & (middle[:, 2] > 20)
    return vertices, faces[~slit].astype(np.int32)


def test_a_slit_is_closed_and_the_opening_stays() -> None:
    vertices, faces = close_holes(*cylinder_with_slit(10.0), 190.0, 20.0, 2.0)
    lengths = sorted(np.ptp(vertices[rim][:, 2]) for rim in rims(faces))
    # Both ends are open still; the slit reached 60 mm down from the upper one.
    assert len(lengths) == 2
    assert lengths[1] < 10.0
    patch = vertices[220 * 81 :]
    # The mouth is bridged by a straight edge of at most 12 mm, 12² / (8 * 35) = 0.51 mm inside the cylinder.
    assert np.abs(np.hypot(patch[:, 0], patch[:, 1]) - 35).max() < 0.6


def test_a_wide_gap_is_no_slit() -> None:
    vertices, faces = cylinder_with_slit(40.0)
    assert len(close_holes(vertices, faces, 190.0, 20.0, 2.0)[1]) == len(faces)
