import numpy as np
import pytest
import trimesh

from footscan.measure.foot_surface import FootSurface
from footscan.measure.frame.foot_frame import FootFrame
from footscan.measure.girths import girth, tape
from footscan.measure.outline import Plane
from footscan.measure.quantity import NotMeasurable, Quantity

ALONG = np.array([1.0, 0.0, 0.0])


def prism(outline: np.ndarray, length: float = 60.0, step: float = 1.0) -> trimesh.Trimesh:
    """Along X from -length / 2, over (N, 2) points (Y, Z), counter-clockwise, without ends; edges about `step` long."""
    count, rings = len(outline), int(length / step) + 1
    x = np.linspace(-length / 2, length / 2, rings)
    vertices = np.array([(at, y, z) for at in x for y, z in outline])
    number = np.arange(count * rings).reshape(rings, count)
    a, b, c, d = number[:-1], np.roll(number, -1, 1)[:-1], number[1:], np.roll(number, -1, 1)[1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([b, d, c], -1).reshape(-1, 3)])
    return trimesh.Trimesh(vertices, faces, process=False)


def ellipse(a: float, b: float, count: int = 300) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return np.column_stack([a * np.cos(angle), b * np.sin(angle)])


def polygon(corners: list[tuple[float, float]], step: float = 1.0) -> np.ndarray:
    points = []
    for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
        parts = max(int(np.hypot(end[0] - start[0], end[1] - start[1]) / step), 1)
        points += [np.array(start) + (np.array(end) - np.array(start)) * k / parts for k in range(parts)]
    return np.array(points)


def surface(mesh: trimesh.Trimesh, noise: float = 0.0, seed: int = 0) -> FootSurface:
    vertices = np.array(mesh.vertices)
    if noise:
        vertices += mesh.vertex_normals * np.random.default_rng(seed).normal(0, noise, (len(vertices), 1))
    faces = np.asarray(mesh.faces, np.int32)
    return FootSurface(FootFrame(vertices, faces, vertices, np.eye(4), "toe2", 250.0), {})


def around(foot: FootSurface, direction: np.ndarray = ALONG) -> Quantity:
    return girth(foot, lambda _: (Plane.across(np.zeros(3), direction), np.zeros(3)), [])


def test_a_cylinder() -> None:
    measured = around(surface(prism(ellipse(40, 40))))
    assert measured.value == pytest.approx(2 * np.pi * 40, rel=1e-3)
    assert measured.surface_length == pytest.approx(2 * np.pi * 40, rel=1e-3)


@pytest.mark.parametrize(("a", "b"), [(50.0, 30.0), (45.0, 20.0)])
def test_an_ellipse_by_ramanujan(a: float, b: float) -> None:
    h = ((a - b) / (a + b)) ** 2
    exact = np.pi * (a + b) * (1 + 3 * h / (10 + np.sqrt(4 - 3 * h)))
    assert around(surface(prism(ellipse(a, b)))).value == pytest.approx(exact, rel=1e-3)


def test_an_oblique_section() -> None:
    direction = np.array([np.cos(0.5), np.sin(0.5), 0.0])
    a, b = 40.0 / np.cos(0.5), 40.0
    h = ((a - b) / (a + b)) ** 2
    exact = np.pi * (a + b) * (1 + 3 * h / (10 + np.sqrt(4 - 3 * h)))
    assert around(surface(prism(ellipse(40, 40), 100.0)), direction).value == pytest.approx(exact, rel=1e-3)


def test_a_d_with_a_notch() -> None:
    # Half a disc of radius 40 over a flat sole, in which a notch is 20 wide and 24 deep: two sides of 26 mm.
    arc = [(40 * np.cos(t), 40 * np.sin(t)) for t in np.linspace(0, np.pi, 126)]
    corners = [*arc, (-10.0, 0.0), (0.0, 24.0), (10.0, 0.0)]
    measured = around(surface(prism(polygon(corners) + np.array([0.0, -10.0]))))
    assert measured.value == pytest.approx(np.pi * 40 + 80, rel=1e-3)
    assert measured.surface_length == pytest.approx(np.pi * 40 + 60 + 2 * 26, rel=1e-3)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("noise", [0.1, 0.3])
def test_noise_changes_little(noise: float, seed: int) -> None:
    clean = around(surface(prism(ellipse(48, 30))))
    noisy = around(surface(prism(ellipse(48, 30)), noise, seed))
    assert noisy.value == pytest.approx(clean.value, abs=0.5 if noise > 0.2 else 0.2)
    assert noisy.surface_length == pytest.approx(clean.surface_length, abs=0.5 if noise > 0.2 else 0.2)


def test_the_errors_of_the_vertices_make_that_of_the_girth() -> None:
    foots = [surface(prism(ellipse(40, 40)), 0.1, seed) for seed in range(40)]
    measured = [around(foot) for foot in foots]
    predicted = np.mean(
        [quantity.sd(np.full(len(foot.noise), 0.1)) or 0 for quantity, foot in zip(measured, foots, strict=True)]
    )
    assert predicted == pytest.approx(np.std([quantity.value for quantity in measured]), rel=0.5)


def test_a_cylinder_that_grows_by_1_has_a_girth_larger_by_2_pi() -> None:
    measured = around(surface(prism(ellipse(40, 40))))
    assert measured.gradient.sum() == pytest.approx(2 * np.pi, rel=1e-2)


def test_a_girth_follows_its_station() -> None:
    cone = prism(ellipse(1, 1))
    vertices = np.array(cone.vertices)
    vertices[:, 1:] *= 40 + 0.2 * vertices[:, :1]
    foot = surface(trimesh.Trimesh(vertices, cone.faces, process=False))
    weights = np.zeros(len(vertices))
    weights[0] = 1.0
    measured = girth(
        foot,
        lambda at: (Plane.across(np.array([at[0], 0, 0]), ALONG), np.array([at[0], 0, 0])),
        [Quantity(5.0, weights)],
    )
    assert measured.value == pytest.approx(2 * np.pi * 41, rel=1e-3)
    assert measured.gradient[0] == pytest.approx(2 * np.pi * 0.2, rel=1e-2)


@pytest.mark.parametrize(("width", "problem"), [(3.0, None), (12.0, "a gap of 1[0-4] mm")])
def test_narrow_gaps_are_closed_and_wide_ones_told(width: float, problem: str | None) -> None:
    mesh = prism(ellipse(40, 40))
    middle = mesh.triangles_center
    mesh.update_faces(~((np.abs(middle[:, 1]) < width / 2) & (middle[:, 2] > 0)))
    if problem is None:
        assert around(surface(mesh)).value == pytest.approx(2 * np.pi * 40, abs=0.1)
    else:
        with pytest.raises(NotMeasurable, match=problem):
            around(surface(mesh))


def test_the_loop_around_the_seed_is_taken() -> None:
    other = prism(ellipse(60, 60))
    other.apply_translation([0, 150, 0])
    foot = surface(trimesh.util.concatenate([prism(ellipse(40, 40)), other]))
    assert around(foot).value == pytest.approx(2 * np.pi * 40, rel=1e-3)


def test_short_loops_are_no_section_of_a_foot() -> None:
    with pytest.raises(NotMeasurable, match="no section"):
        around(surface(prism(ellipse(9, 9, 60))))


def test_a_tape_touches_at_the_corners_of_the_hull() -> None:
    foot = surface(prism(polygon([(-30, -20), (30, -20), (30, 20), (0, 5), (-30, 20)])))
    plane = Plane.across(np.zeros(3), ALONG)
    outline = foot.outline(plane, np.zeros(3))
    measured = tape(outline)
    assert measured.length == pytest.approx(200.0, rel=1e-3)
    reached = {tuple(corner) for corner in np.round(outline.points[measured.corners]).tolist()}
    assert {(-30.0, -20.0), (30.0, -20.0), (30.0, 20.0), (-30.0, 20.0)} <= reached
    assert (0.0, 5.0) not in reached
