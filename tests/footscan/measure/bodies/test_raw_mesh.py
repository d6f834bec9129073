from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from footscan.measure.bodies.raw_mesh import MeshUnit, RawMesh, prepare_mesh
from footscan.measure.frame.foot_frame import foot_frame
from footscan.virtual.foot.foot import Foot, make_foot
from schemas.base.errors import Finding

Shape = tuple[np.ndarray, np.ndarray]


@lru_cache
def known_foot() -> Foot:
    return make_foot(resolution_mm=2.0)


def taken(vertices: np.ndarray, faces: np.ndarray, unit: MeshUnit | None = None) -> RawMesh:
    return prepare_mesh(Rotation.random(random_state=2).apply(vertices), faces, unit)


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("in", 25.4)])
def test_the_unit_is_told_by_the_size(unit: str, factor: float) -> None:
    foot = known_foot()
    mesh = taken(foot.vertices / factor, foot.faces)
    assert (mesh.unit, mesh.factor, mesh.is_closed) == (unit, factor, True)
    assert len(mesh.notes) == (unit != "mm")
    assert all(f"multiplied by {factor:g}" in note for note in mesh.notes)
    assert foot_frame(mesh.vertices, mesh.faces, "right").length == pytest.approx(262.0, abs=0.1)


def test_what_may_be_inches_or_a_child_in_centimetres_must_be_stated() -> None:
    foot = known_foot()  # 262 mm long: 12.3 of a unit is 123 or 312 mm
    with pytest.raises(Finding, match=r"123 mm if in cm or 312 mm if in in; expected the unit to be stated"):
        taken(foot.vertices * 12.3 / 262, foot.faces)
    mesh = taken(foot.vertices * 12.3 / 262, foot.faces, unit="cm")
    assert foot_frame(mesh.vertices, mesh.faces, "right").length == pytest.approx(123.0, abs=0.2)
    assert "cm, as stated" in mesh.notes[0]


def test_a_surface_that_looks_inward_is_turned_over() -> None:
    foot = known_foot()
    mesh = taken(foot.vertices, foot.faces[:, ::-1])
    np.testing.assert_array_equal(mesh.faces, taken(foot.vertices, foot.faces).faces)
    assert mesh.notes == ("the surface faced inward and was turned over",)


def test_open_meshes_are_accepted() -> None:
    foot = known_foot()
    height = foot.vertices[foot.faces][:, :, 2].mean(axis=1)
    mesh = taken(foot.vertices, foot.faces[height < 106])
    assert not mesh.is_closed
    assert "open" in mesh.notes[0]
    assert foot_frame(mesh.vertices, mesh.faces, "right").length == pytest.approx(262.0, abs=0.1)


def test_triangles_of_their_own_vertices_are_joined() -> None:
    foot = known_foot()
    mesh = taken(foot.vertices[foot.faces].reshape(-1, 3), np.arange(foot.faces.size).reshape(-1, 3))
    assert mesh.is_closed
    assert len(mesh.vertices) == len(foot.vertices)


def test_strays_are_left_out() -> None:
    foot = known_foot()
    stray = trimesh.creation.icosphere(subdivisions=1, radius=3.0)
    vertices = np.concatenate([foot.vertices, stray.vertices + np.array([100, 120, 60])])
    mesh = taken(vertices, np.concatenate([foot.faces, stray.faces + len(foot.vertices)]))
    assert len(mesh.faces) == len(foot.faces)
    assert mesh.notes == ("1 small part apart from the foot left out",)


def fine(mesh: trimesh.Trimesh) -> Shape:
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, 8.0)
    return np.asarray(vertices), np.asarray(faces, np.int32)


def ball(*half_axes: float) -> Shape:
    sphere = trimesh.creation.icosphere(subdivisions=4)
    return np.asarray(sphere.vertices) * half_axes, np.asarray(sphere.faces, np.int32)


def two_feet() -> Shape:
    foot = known_foot()
    beside = foot.vertices * [1, -1, 1] + [10, 130, 0]
    faces = np.concatenate([foot.faces, foot.faces[:, ::-1] + len(foot.vertices)])
    return np.concatenate([foot.vertices, beside]), faces


def sheet() -> Shape:
    grid = trimesh.creation.box(extents=(260, 100, 1))
    vertices, faces = fine(grid)
    return vertices * [1, 1, 0], faces


NO_FEET = {
    "block": (fine(trimesh.creation.box(extents=(250, 100, 60))), "without hollows|high at one end"),
    "cube": (fine(trimesh.creation.box(extents=(200, 200, 200))), "mm long and .* mm broad"),
    "slab": (fine(trimesh.creation.box(extents=(250, 100, 20))), "expected a foot"),
    "sphere": (ball(100, 100, 100), "mm long and .* mm broad"),
    "hand-sized blob": (ball(95, 45, 20), "without hollows"),
    "big blob": (ball(130, 55, 50), "without hollows"),
    "cylinder": (fine(trimesh.creation.cylinder(45, 250)), "without hollows"),
    "torus": (fine(trimesh.creation.torus(100, 30)), "expected a foot"),
    "two feet": (two_feet(), "2 separate bodies"),
    "sheet": (sheet(), "flat"),
    "12 triangles": ((trimesh.creation.box().vertices * 200, trimesh.creation.box().faces), "12 triangles"),
    "nothing": ((np.zeros((0, 3)), np.zeros((0, 3), np.int32)), "0 triangles"),
    "ten times a foot": ((known_foot().vertices * 10, known_foot().faces), "2.62e\\+03 long, expected a foot"),
}


@pytest.mark.parametrize(("shape", "problem"), NO_FEET.values(), ids=NO_FEET.keys())
def test_no_foot_is_a_finding(shape: Shape, problem: str) -> None:
    def measured() -> None:
        mesh = taken(*shape)
        foot_frame(mesh.vertices, mesh.faces, "unknown")

    with pytest.raises(Finding, match=problem) as caught:
        measured()
    assert "\n" not in str(caught.value)


def test_coordinates_that_are_no_numbers_are_a_finding() -> None:
    foot = known_foot()
    broken = foot.vertices.copy()
    broken[7, 1] = np.nan
    with pytest.raises(Finding, match="no numbers"):
        prepare_mesh(broken, foot.faces)


def turned_hallux(vertices: np.ndarray) -> np.ndarray:
    x, y, z = vertices.T
    return np.column_stack([x, y - 0.12 * np.clip(x - 195, 0, None) * (y > 4), z])


ODD_FEET = {
    "a child's": lambda vertices: vertices * 120 / 262,
    "hallux valgus": turned_hallux,
    "raised toes": lambda vertices: vertices + np.outer(np.clip(vertices[:, 0] - 200, 0, None) ** 2, [0, 0, 0.008]),
    "slender": lambda vertices: vertices * [1.05, 0.8, 1.0],
    "broad": lambda vertices: vertices * [0.9, 1.2, 1.0],
    "bare of its leg": lambda vertices: vertices * [1, 1, 0.7],
}


@pytest.mark.parametrize("form", ODD_FEET.values(), ids=ODD_FEET.keys())
def test_odd_feet_are_feet(form: Callable[[np.ndarray], np.ndarray]) -> None:
    foot = known_foot()
    vertices = form(foot.vertices)
    mesh = taken(vertices, foot.faces)
    frame = foot_frame(mesh.vertices, mesh.faces, "unknown")
    assert (frame.side, frame.side_note) == ("right", None)
    assert frame.length == pytest.approx(np.ptp(vertices[:, 0]), abs=1.0)
