"""Subjects of worlds, and their true measures."""

import numpy as np
import pytest
import trimesh

from footscan.virtual.worlds.draw import draw_world
from footscan.virtual.worlds.subject import make_subject
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
    stump = make_subject(WorldSubject(deformity=Deformity(amputated_at=0.6)), 4.0).measures
    assert stump["ball_girth"] is None
    assert stump["foot_length"] == pytest.approx(0.6 * 262.0, abs=0.5)
    without = make_subject(WorldSubject(deformity=Deformity(missing_toes=[1])), 4.0).measures
    assert without["toe_height"] is None
    assert without["ball_girth"] == pytest.approx(whole["ball_girth"], abs=0.05)


def test_a_last_is_shorter_than_its_foot_and_has_no_toes() -> None:
    last = make_subject(WorldSubject(kind="last", toe_gap_mm=-1.0), 4.0)
    assert last.measures["ball_girth"] is None
    length = np.ptp(last.mesh.vertices[:, 0])
    assert last.measures["foot_length"] == pytest.approx(length, abs=0.5)
