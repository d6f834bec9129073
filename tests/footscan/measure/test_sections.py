import numpy as np
import pytest
import trimesh

from footscan.measure.sections import below, cut, tape_girth, widest_gap

ALONG = np.array([1.0, 0.0, 0.0])


def cylinder() -> tuple[np.ndarray, np.ndarray]:
    """Radius 40 mm, axis along X from -50 to 50."""
    mesh = trimesh.creation.cylinder(radius=40.0, height=100.0, sections=360)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def test_tape_around_a_cylinder() -> None:
    section = cut(*cylinder(), np.zeros(3), ALONG)
    assert tape_girth(section, ALONG) == pytest.approx(2 * np.pi * 40, rel=1e-4)
    assert widest_gap(section) == 0.0


def test_tape_around_an_oblique_section() -> None:
    normal = np.array([np.cos(0.5), np.sin(0.5), 0.0])
    a, b = 40.0 / np.cos(0.5), 40.0
    h = ((a - b) / (a + b)) ** 2
    ramanujan = np.pi * (a + b) * (1 + 3 * h / (10 + np.sqrt(4 - 3 * h)))
    assert tape_girth(cut(*cylinder(), np.zeros(3), normal), normal) == pytest.approx(ramanujan, rel=1e-4)


def test_a_tape_bridges_a_hollow() -> None:
    # A channel 60 wide and 40 high along X, with a notch from above: the tape runs straight over it.
    outline = [(0, 0), (60, 0), (60, 40), (40, 40), (30, 10), (20, 40), (0, 40)]
    ends = [np.array([(x, y, z) for y, z in outline], float) for x in (0.0, 100.0)]
    k, following = np.arange(7), np.roll(np.arange(7), -1)
    sides = np.concatenate([np.column_stack([k, following, k + 7]), np.column_stack([following, following + 7, k + 7])])
    section = cut(np.concatenate(ends), sides, np.array([50.0, 0, 0]), ALONG)
    assert tape_girth(section, ALONG) == pytest.approx(200.0)


def test_a_plane_that_misses() -> None:
    section = cut(*cylinder(), np.array([80.0, 0, 0]), ALONG)
    assert len(section.points) == 0
    assert tape_girth(section, ALONG) is None


def test_gaps_are_found_and_high_ones_left_out() -> None:
    vertices, faces = cylinder()
    middle = vertices[faces].mean(axis=1)
    gap = (np.abs(middle[:, 1]) < 10) & (middle[:, 2] > 0)
    section = cut(vertices, faces[~gap], np.zeros(3), ALONG)
    # Facets are 0.7 mm wide: the opening is 20 mm and up to two facets more or less.
    assert widest_gap(section) == pytest.approx(20.0, abs=1.5)
    assert widest_gap(below(section, 30.0)) == 0.0
    assert below(section, 30.0).points[:, 2].max() <= 30.0
