"""What is said of parts of a foot, against what is known of the whole one."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest
import trimesh
from _pytest.mark import ParameterSet
from scipy.spatial.transform import Rotation

from footscan.measure.bodies.raw_mesh import RawMesh, prepare_feet
from footscan.measure.measures import measure_foot
from footscan.measure.partial import measure_pair, measure_raw
from footscan.mesh.topology import vertex_normals
from footscan.virtual.foot.foot import Foot, make_foot
from schemas.base.errors import Finding
from schemas.measures import Measure, Measures

Shape = tuple[np.ndarray, np.ndarray]

LEAST_MM, SCATTERS = 0.5, 3.0
"""An error of a measure with status "ok" is below the first, or below this number of its standard deviations."""
OF_THE_CUT = ("scan_height",)
"""Measures of the mesh rather than of the foot."""


@lru_cache
def known_foot() -> Foot:
    return make_foot(resolution_mm=2.0)


@lru_cache
def measured_whole() -> dict[str, Measure]:
    return measure_foot(known_foot().vertices, known_foot().faces, "right").measures


def cut(keep: tuple[float, float, float], at: float, cap: bool = False) -> Shape:
    """The foot on the side of a plane to which `keep` points, cut exactly; `at` is along the plane's axis, mm."""
    foot = known_foot()
    axis = int(np.argmax(np.abs(keep)))
    inside = (foot.vertices[:, axis] - at) * keep[axis]
    vertices, faces, made = list(foot.vertices), [], {}

    def between(a: int, b: int) -> int:
        edge = min(a, b), max(a, b)
        if edge not in made:
            share = inside[a] / (inside[a] - inside[b])
            made[edge] = len(vertices)
            vertices.append(foot.vertices[a] + share * (foot.vertices[b] - foot.vertices[a]))
        return made[edge]

    rims = []
    for face in foot.faces[(inside[foot.faces] >= 0).any(axis=1)]:
        ring: list[int] = []
        for a, b in zip(face, np.roll(face, -1), strict=True):
            ring += [a] if inside[a] >= 0 else []
            ring += [between(a, b)] if (inside[a] >= 0) != (inside[b] >= 0) else []
        faces += [(ring[0], ring[k], ring[k + 1]) for k in range(1, len(ring) - 1)]
        rims += [
            (a, b) for a, b in zip(ring, np.roll(ring, -1), strict=True) if min(a, b) >= len(foot.vertices) and a != b
        ]
    if cap:  # by a fan
        vertices.append(np.mean([vertices[a] for a, _ in rims], axis=0))
        faces += [(b, a, len(vertices) - 1) for a, b in rims]
    used, numbers = np.unique(np.array(faces), return_inverse=True)
    return np.array(vertices)[used], numbers.reshape(-1, 3).astype(np.int32)


def together(*shapes: Shape) -> Shape:
    before = np.cumsum([0, *(len(vertices) for vertices, _ in shapes)])
    faces = [faces + count for (_, faces), count in zip(shapes, before, strict=False)]
    return np.concatenate([vertices for vertices, _ in shapes]), np.concatenate(faces).astype(np.int32)


def plate(height: float) -> Shape:
    sheet = trimesh.creation.box(extents=(420, 240, 1))
    vertices, faces = trimesh.remesh.subdivide_to_size(sheet.vertices, sheet.faces, 20.0)
    upper = faces[(vertices[faces][:, :, 2] > 0).all(axis=1)]
    used, numbers = np.unique(upper, return_inverse=True)
    return vertices[used] + [130, 0, height - 0.5], numbers.reshape(-1, 3)


def in_metres(shape: Shape) -> Shape:
    return shape[0] / 1000, shape[1]


def with_strays(shape: Shape) -> Shape:
    places = np.random.default_rng(1).uniform((-40, -80, 0), (300, 80, 100), (12, 3))
    stray = np.array([[0.0, 0, 0], [3, 0, 0], [0, 3, 1]])
    strays = np.concatenate([place + stray for place in places])
    return together(shape, (strays, np.arange(len(strays)).reshape(-1, 3)))


def rough(shape: Shape, mm: float) -> Shape:
    """The shape with vertices that scatter along their normals, as those of a depth camera."""
    vertices, faces = np.asarray(shape[0]), np.asarray(shape[1])
    scatter = np.random.default_rng(3).normal(0.0, mm, (len(vertices), 1))
    return vertices + scatter * vertex_normals(vertices, faces), faces


UP, DOWN, AHEAD, BACK = (0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0)
SOLE_OPEN: dict[str, Callable[[], Shape]] = {
    "cut at 1 mm": lambda: cut(UP, 1.0),
    "cut at 3 mm": lambda: cut(UP, 3.0),
    "cut at 8 mm": lambda: cut(UP, 8.0),
    "filled at 3 mm": lambda: cut(UP, 3.0, cap=True),
    "in metres": lambda: in_metres(cut(UP, 3.0)),
    "with strays": lambda: with_strays(cut(UP, 3.0)),
    "on a floor": lambda: together(cut(UP, 3.0), plate(0.0)),
}
OTHERS: dict[str, Callable[[], Shape]] = {
    "whole on a floor": lambda: together((known_foot().vertices, known_foot().faces), plate(-0.5)),
    "without toes, closed": lambda: cut(BACK, 220.0, cap=True),
    "without toes, open": lambda: cut(BACK, 220.0),
    "without forefoot, closed": lambda: cut(BACK, 162.0, cap=True),
    "without forefoot, open": lambda: cut(BACK, 162.0),
    "without heel": lambda: cut(AHEAD, 50.0),
    "cut low": lambda: cut(DOWN, 60.0, cap=True),
    "rough": lambda: rough((known_foot().vertices, known_foot().faces), 0.5),
    "rough and cut at 3 mm": lambda: rough(cut(UP, 3.0), 0.2),
}

SHELLS: dict[str, Callable[[], Shape]] = {
    "sole up to 10 mm": lambda: cut(DOWN, 10.0),
    "sole up to 15 mm": lambda: cut(DOWN, 15.0),
    "sole up to 15 mm, closed": lambda: cut(DOWN, 15.0, cap=True),
    "sole up to 25 mm": lambda: cut(DOWN, 25.0),
    "sole up to 25 mm, closed": lambda: cut(DOWN, 25.0, cap=True),
    "sole up to 35 mm, rough": lambda: rough(cut(DOWN, 35.0), 0.2),
    "sole up to 25 mm, in metres, with strays": lambda: in_metres(with_strays(cut(DOWN, 25.0))),
}


RARE = (
    *("cut at 1 mm", "cut at 8 mm", "in metres"),
    *("without toes, open", "without forefoot, closed", "cut low"),
    *("sole up to 10 mm", "sole up to 15 mm, closed", "sole up to 25 mm"),
)
"""Bodies between others, with the slow tests."""


def each(shapes: dict[str, Callable[[], Shape]]) -> list[ParameterSet]:
    marks = {name: [pytest.mark.slow] if name in RARE else [] for name in shapes}
    return [pytest.param(shape, id=name, marks=marks[name]) for name, shape in shapes.items()]


def taken(shape: Shape) -> tuple[RawMesh, Measures]:
    vertices = Rotation.random(random_state=5).apply(shape[0])
    (mesh,) = prepare_feet(vertices, shape[1])
    return mesh, measure_raw(mesh, "right")


def check(measures: Measures) -> None:
    """No measure of status "ok" is wrong."""
    wrong = {}
    for name, true in known_foot().measures.items():
        measure = measures.measures[name]
        if measure.status == "ok" and measure.value is not None and name not in OF_THE_CUT:
            error = measure.value - true
            if abs(error) > max(LEAST_MM, SCATTERS * (measure.uncertainty or 0.0)):
                wrong[name] = error
    assert wrong == {}


@pytest.mark.parametrize("shape", each(OTHERS))
def test_no_measure_that_is_ok_is_wrong(shape: Callable[[], Shape]) -> None:
    check(taken(shape())[1])


@pytest.mark.parametrize("shape", each(SOLE_OPEN))
def test_a_sole_that_was_not_seen_is_closed_flat_by_the_floor(shape: Callable[[], Shape]) -> None:
    mesh, found = taken(shape())
    check(found)
    assert "the sole was not seen and was closed flat at the floor" in mesh.notes
    assert mesh.closing is not None
    height = mesh.vertices @ mesh.to_floor[2, :3] + mesh.to_floor[2, 3]
    assert np.ptp(height[mesh.closing]) < 0.01
    assert height.min() > -0.1
    measures, true = found.measures, known_foot().measures
    for name in ("foot_length", "foot_breadth", "heel_breadth", "instep_height", "ball_girth", "instep_girth"):
        assert measures[name].value == pytest.approx(true[name], abs=9.0), name
    for name in ("instep_height", "ball_girth", "waist_girth", "instep_girth", "heel_girth"):
        assert measures[name].status == "uncertain"
        assert "closed by the floor" in str(measures[name].note)
    for name in ("arch_height", "arch_index", "staheli_index"):
        assert measures[name].status == "incomplete"


@pytest.mark.parametrize("shape", each(SHELLS))
def test_a_sole_alone_is_measured_as_far_as_it_goes(shape: Callable[[], Shape]) -> None:
    mesh, found = taken(shape())
    check(found)
    assert "the upper side was not seen, only the sole with its rim" in mesh.notes
    measures, true = found.measures, measured_whole()
    for name in ("arch_index", "chippaux_smirak_index", "staheli_index"):
        assert measures[name].value == pytest.approx(true[name].value, abs=0.01), name
    assert measures["foot_length"].value == pytest.approx(true["foot_length"].value, abs=5.0)
    for name in ("instep_height", "instep_girth", "heel_girth", "ankle_girth", "foot_volume", "scan_height"):
        assert measures[name].status == "incomplete", name
    for name, measure in measures.items():
        if measure.value is not None and measure.uncertainty is not None and (value := true[name].value) is not None:
            assert abs(measure.value - value) < max(LEAST_MM, SCATTERS * measure.uncertainty), name


def test_the_length_of_a_low_sole_is_uncertain_and_that_of_a_higher_one_is_not() -> None:
    for height, status in ((10.0, "uncertain"), (15.0, "uncertain"), (30.0, "ok")):
        length = taken(cut(DOWN, height))[1].measures["foot_length"]
        assert length.status == status, height
        assert ("the upper side is missing" in str(length.note)) == (status == "uncertain")


def test_a_tray_is_no_sole() -> None:
    box = trimesh.creation.box(extents=(260, 90, 25))
    vertices, faces = trimesh.remesh.subdivide_to_size(box.vertices, box.faces, 8.0)
    tray = faces[(vertices[faces][:, :, 2] < 12.4).any(axis=1)]
    with pytest.raises(Finding):
        taken((vertices, tray))


def test_a_floor_that_is_joined_to_the_foot_is_cut_away() -> None:
    vertices, faces = cut(UP, 3.0)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    rims = mesh.edges[trimesh.grouping.group_rows(mesh.edges_sorted, require_count=1)]
    places = vertices[rims]
    low = rims[((places[:, :, 2] < 3.01) & (places[:, :, 1] < -20) & (places[:, :, 0] < 200)).all(axis=1)]
    ends, numbers = np.unique(low, return_inverse=True)
    outer = vertices[ends] - np.array([0, 80, 0])
    first, second = (numbers.reshape(low.shape) + len(vertices)).T
    ring = np.concatenate([np.column_stack([low[:, 1], low[:, 0], first]), np.column_stack([low[:, 1], first, second])])
    found, measures = taken((np.concatenate([vertices, outer]), np.concatenate([faces, ring]).astype(np.int32)))
    assert "a flat part under the foot, the floor, was left out" in found.notes
    assert measures.measures["foot_length"].value == pytest.approx(known_foot().measures["foot_length"], abs=0.5)
    check(measures)


@pytest.mark.parametrize("is_open", [False, True])
def test_both_feet_are_told_apart_by_their_form(is_open: bool) -> None:
    vertices, faces = cut(UP, 3.0) if is_open else (known_foot().vertices, known_foot().faces)
    left = vertices * [1, -1, 1] + [15, 140, 0], faces[:, ::-1]
    shape = together(left, (vertices, faces))
    first, second = prepare_feet(*shape)
    pair = measure_pair((first, second))
    for side, (mesh, measures) in pair.items():
        assert measures.side == side
        assert mesh.vertices[:, 1].mean() == pytest.approx(140.0 if side == "left" else 0.0, abs=10.0)
        check(measures)


def test_two_right_feet_are_no_pair() -> None:
    foot = known_foot()
    shape = together((foot.vertices, foot.faces), (foot.vertices + np.array([0, 140, 0]), foot.faces))
    first, second = prepare_feet(*shape)
    with pytest.raises(Finding, match="2 separate bodies"):
        measure_pair((first, second))
