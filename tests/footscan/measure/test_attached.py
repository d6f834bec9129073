from functools import lru_cache

import numpy as np
import open3d as o3d
import pymeshlab
import pytest

from footscan.measure.measures import measure_foot
from footscan.virtual.foot.foot import Foot, make_foot, sample_shape
from schemas.measures import Measures


@lru_cache
def foot() -> Foot:
    return make_foot(resolution_mm=2.0)


def with_thing(thing: o3d.geometry.TriangleMesh) -> Measures:
    """Measures of the foot and a thing, as one surface."""
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(foot().vertices, foot().faces))
    meshes.add_mesh(pymeshlab.Mesh(np.asarray(thing.vertices), np.asarray(thing.triangles)))
    meshes.generate_boolean_union(first_mesh=0, second_mesh=1)  # that of Open3D 0.20 ends some processes by SIGSEGV
    both = meshes.current_mesh()
    return measure_foot(both.vertex_matrix(), both.face_matrix(), "right")


def box(size: tuple[float, float, float], place: tuple[float, float, float]) -> o3d.geometry.TriangleMesh:
    return o3d.geometry.TriangleMesh.create_box(*size).translate(place)


def cylinder(radius: float, height: float, place: tuple[float, float, float]) -> o3d.geometry.TriangleMesh:
    return o3d.geometry.TriangleMesh.create_cylinder(radius, height, 60).translate(place)


def widest(low: float, high: float) -> float:
    x, y, z = foot().vertices.T
    return float(y[(x > low) & (x < high) & (z < 40)].max())


def leg() -> tuple[float, float, float]:
    """Middle of the leg's top, x and y, and half its length, mm."""
    x, y, z = foot().vertices.T
    top = z > z.max() - 1
    return float(x[top].min() + x[top].max()) / 2, float(y[top].mean()), float(np.ptp(x[top]) / 2)


def test_a_bare_foot_has_no_things() -> None:
    measures = measure_foot(foot().vertices, foot().faces, "right")
    assert measures.things == []
    assert measures.measures["foot_length"].status == "ok"


@pytest.mark.parametrize("seed", range(3))
def test_drawn_feet_have_no_things(seed: int) -> None:
    drawn = make_foot(sample_shape(np.random.default_rng(seed), "male"), resolution_mm=2.0)
    assert measure_foot(drawn.vertices, drawn.faces, "right").things == []


def test_a_block_beside_the_foot_makes_its_measures_uncertain() -> None:
    measures = with_thing(box((60, 30, 25), (70, widest(70, 130) - 4, 1)))
    assert [thing[:20] for thing in measures.things] == ["the side of the foot"]
    assert {measure.status for measure in measures.measures.values()} <= {"uncertain", "incomplete"}


def test_a_finger_on_the_back_of_the_foot() -> None:
    x, _, z = foot().vertices.T
    height = float(z[(x > 165) & (x < 175)].max())
    finger = box((16, 90, 16), (165, -20, height - 4))
    assert any(thing.startswith("the back of the foot") for thing in with_thing(finger).things)


def test_a_cuff_around_the_leg() -> None:
    x, y, radius = leg()
    z = float(foot().vertices[:, 2].max())
    ring = cylinder(radius + 2.0, 12, (x, y, z - 8))
    assert any("leg has a step" in thing for thing in with_thing(ring).things)
