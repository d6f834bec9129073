"""Subjects of worlds, and their true measures."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from footscan.virtual.optics.scene import Mesh
from footscan.virtual.worlds.draw import draw_world
from footscan.virtual.worlds.subject import make_body, make_subject
from schemas.world import Deformity, WorldSubject


@pytest.mark.parametrize("seed", range(5))
def test_a_drawn_subject_is_closed_and_as_long_as_its_world_says(seed: int) -> None:
    world = draw_world(seed)
    subject = make_subject(world.subject, 4.0)
    mesh = trimesh.Trimesh(subject.mesh.vertices, subject.mesh.faces, process=False)
    assert mesh.is_watertight
    assert mesh.volume > 0
    assert mesh.bounds[0, 2] == pytest.approx(0.0, abs=0.3)
    assert mesh.bounds[1, 2] == pytest.approx(world.subject.leg_mm, abs=0.1)


def test_measures_grow_with_the_length() -> None:
    small = make_subject(WorldSubject(length_mm=131.0, arch_mm=6.75), 4.0).measures
    large = make_subject(WorldSubject(length_mm=262.0, arch_mm=13.5), 4.0).measures
    assert small["foot_length"] == pytest.approx(131.0, abs=0.6)
    assert small["arch_index"] != small["foot_length"]
    assert large["foot_length"] == pytest.approx(262.0, abs=0.6)


def test_a_turned_foot_stays_in_the_middle() -> None:
    mesh = make_subject(WorldSubject(turn_deg=20.0, y_mm=10.0, leg_mm=90.0), 4.0).mesh
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2.0
    assert middle[:2] == pytest.approx([200.0, 10.0], abs=12.0)


def test_what_a_foot_lacks_has_no_measure() -> None:
    whole = make_subject(WorldSubject(), 4.0).measures
    assert None not in whole.values()
    without = make_subject(WorldSubject(deformity=Deformity(missing_toes=[1])), 4.0).measures
    assert without["toe_height"] is None
    assert without["ball_girth"] == pytest.approx(whole["ball_girth"], abs=0.05)


@pytest.mark.parametrize(
    "subject",
    [
        WorldSubject(deformity=Deformity(amputated_at=0.6)),
        WorldSubject(deformity=Deformity(missing_toes=[2])),
        WorldSubject(kind="last", toe_gap_mm=-1.0),
    ],
)
def test_without_a_second_toe_there_is_no_axis_to_measure_along(subject: WorldSubject) -> None:
    measures = make_subject(subject, 4.0).measures
    assert "foot_length" in measures
    assert set(measures.values()) == {None}


@pytest.mark.parametrize("length_mm", [150.0, 262.0, 320.0])
def test_definitions_in_mm_do_not_grow_with_a_foot(length_mm: float) -> None:
    """The big toe is measured 12.5 mm behind its tip whatever the length of the foot."""
    mesh = (subject := make_subject(WorldSubject(length_mm=length_mm), 1.0)).mesh
    heel = mesh.vertices[:, 0].min()
    assert subject.measures["foot_length"] == pytest.approx(length_mm, abs=0.2)
    tip = mesh.vertices[(mesh.vertices[:, 1] > 0.02 * length_mm) & (mesh.vertices[:, 2] < 0.1 * length_mm), 0].max()
    near = mesh.vertices[np.abs(mesh.vertices[:, 0] - tip + 12.5) < 1.0]
    near = near[near[:, 1] > 0.02 * length_mm]
    assert subject.measures["toe_height"] == pytest.approx(near[:, 2].max(), abs=0.3)
    low = mesh.vertices[(mesh.vertices[:, 2] <= 40.0) & (mesh.vertices[:, 2] >= 2.0)]
    along = (low[:, 0] - heel) / length_mm
    assert subject.measures["heel_breadth"] == pytest.approx(np.ptp(low[(along >= 0.1) & (along <= 0.2), 1]), abs=0.5)


def test_the_mesh_that_is_filmed_has_the_true_girth() -> None:
    subject = make_subject(WorldSubject())
    mesh = trimesh.Trimesh(subject.mesh.vertices, subject.mesh.faces, process=False)
    section = mesh.section(plane_origin=[200.0, 0.0, 0.0], plane_normal=[1.0, 0.0, 0.0])  # half the length
    girth = ConvexHull(section.vertices[:, 1:]).area
    assert girth == pytest.approx(subject.measures["instep_girth"], abs=0.03)


def test_a_body_stands_in_the_middle_and_keeps_its_form() -> None:
    corners = np.array([[x, y, z] for x in (-40.0, 40.0) for y in (-20.0, 20.0) for z in (0.0, 50.0)])
    box = Mesh(corners, ConvexHull(corners).simplices.astype(np.int64))
    body = make_body(box, seed=5)
    low, high = body.mesh.vertices.min(axis=0), body.mesh.vertices.max(axis=0)
    assert (low[2], high[2]) == (0.0, 50.0)
    assert (low + high)[:2] / 2.0 == pytest.approx([200.0, 0.0], abs=5.0)
    edges = body.mesh.vertices[body.mesh.faces] - body.mesh.vertices[np.roll(body.mesh.faces, 1, axis=1)]
    assert np.linalg.norm(edges, axis=2).max() <= 8.0
    _, counts = np.unique(np.sort(body.mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)), axis=0, return_counts=True)
    assert set(counts) == {2}
    far = np.linalg.norm(body.mesh.vertices[:, :2] - (low + high)[:2] / 2.0, axis=1).max()
    assert far == pytest.approx(np.hypot(40.0, 20.0))
