import numpy as np
import pytest
import trimesh

from footscan.measure.foot_landmarks import Landmark
from footscan.measure.foot_surface import FootSurface
from footscan.measure.frame.foot_frame import FootFrame
from footscan.measure.landmarks.extreme import Cap
from footscan.measure.quantity import NotMeasurable
from footscan.measure.solid import foot_surface, foot_volume


def cut_at(mesh: trimesh.Trimesh, level: float, noise: float = 0.0) -> FootSurface:
    vertices = np.array(mesh.vertices)
    if noise:
        vertices += mesh.vertex_normals * np.random.default_rng(0).normal(0, noise, (len(vertices), 1))
    frame = FootFrame(vertices, np.asarray(mesh.faces, np.int32), vertices, np.eye(4), "toe2", 250.0)
    junction = Landmark(np.array([0.0, 0.0, level]), "manual", 1.0)
    return FootSurface(frame, {"junction_point": junction})


def block() -> trimesh.Trimesh:
    """200 x 80 x 100 mm on the floor."""
    mesh = trimesh.creation.box(bounds=[[0, 0, 0], [200, 80, 100]])
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, 9.0)
    return trimesh.Trimesh(vertices, faces)


@pytest.mark.parametrize("level", [37.3, 60.0, 150.0])
def test_a_block(level: float) -> None:
    foot, below = cut_at(block(), level), min(level, 100.0)
    assert foot_volume(foot).value == pytest.approx(200 * 80 * below)
    top = 200 * 80 if level > 100 else 0
    assert foot_surface(foot).value == pytest.approx(200 * 80 + 2 * 280 * below + top)


def test_a_sphere_cap() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=50.0)
    mesh.apply_translation([0, 0, 50])
    foot = cut_at(mesh, 30.0)
    assert foot_volume(foot).value == pytest.approx(np.pi * 30**2 * (50 - 30 / 3), rel=2e-3)
    assert foot_surface(foot).value == pytest.approx(2 * np.pi * 50 * 30, rel=2e-3)
    assert foot_volume(foot).note == "below 30.0 mm"


def test_noise_adds_no_skin() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=50.0)  # edges of 1.7 mm
    mesh.apply_translation([0, 0, 50])
    raw = trimesh.Trimesh(cut_at(mesh, 120.0, 0.2).mesh.vertices, mesh.faces).area
    exact = 4 * np.pi * 50**2
    assert raw > 1.02 * exact
    assert foot_surface(cut_at(mesh, 120.0, 0.2)).value == pytest.approx(exact, rel=0.01)


def test_a_skin_that_moves_outwards_fills_its_area() -> None:
    by_hand = cut_at(block(), 150.0)
    place, cap = np.array([0.0, 0.0, 150.0]), Cap(np.eye(2), 1.0, 0.01)
    by_form, guessed = (
        FootSurface(
            FootFrame(by_hand.mesh.vertices, by_hand.mesh.faces, by_hand.mesh.vertices, np.eye(4), "toe2", 250.0),
            {"junction_point": junction},
        )
        for junction in (Landmark(place, "geometric", 1.0, cap=cap), Landmark(place, "fallback", 0.5))
    )
    for foot in (by_hand, by_form):
        assert foot_volume(foot).gradient.sum() == pytest.approx(2 * (200 * 80 + 280 * 100))
    assert np.isnan(foot_volume(guessed).gradient).all()


def test_small_holes_are_borne_and_wide_ones_are_not() -> None:
    mesh = block()
    low = np.flatnonzero(mesh.triangles_center[:, 2] < 20)
    fine = trimesh.Trimesh(*trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, 2.5))
    small = trimesh.Trimesh(fine.vertices, np.delete(fine.faces, np.argmin(fine.triangles_center[:, 2]), axis=0))
    assert foot_volume(cut_at(small, 50.0)).value == pytest.approx(200 * 80 * 50, rel=1e-3)
    wide = trimesh.Trimesh(mesh.vertices, np.delete(mesh.faces, low[:3], axis=0))
    with pytest.raises(NotMeasurable, match="a hole of"):
        foot_volume(cut_at(wide, 50.0))


def test_holes_above_are_of_no_account() -> None:
    mesh = block()
    high = mesh.triangles_center[:, 2] > 80
    opened = trimesh.Trimesh(mesh.vertices, mesh.faces[~high])
    assert foot_volume(cut_at(opened, 50.0)).value == pytest.approx(200 * 80 * 50)
