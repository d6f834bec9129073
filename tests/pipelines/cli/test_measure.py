"""`footscan measure` with what is no foot, or a foot in a bad state: one clear line each, or the right measures."""

import csv
import json
import re
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from skimage.measure import marching_cubes

from footscan.virtual.filming.record import write_stl
from footscan.virtual.foot.foot import Foot, make_foot
from pipelines.cli.main import run_command
from schemas.measures import Measures

Shape = tuple[NDArray[np.float64], NDArray[np.int32]]
Run = Callable[..., tuple[int, str, list[str]]]
LENGTHS = ("foot_length", "foot_breadth", "ball_girth", "instep_girth")


@lru_cache
def known_foot() -> Foot:
    return make_foot(resolution_mm=3.0)


def whole() -> Shape:
    return known_foot().vertices, known_foot().faces


def part(keep: Callable[[NDArray[np.float64]], NDArray[np.bool_]]) -> Shape:
    """The triangles of a foot whose middles are to be kept; the foot is 262 mm long, its heel at X = 0."""
    vertices, faces = whole()
    return vertices, faces[keep(vertices[faces].mean(axis=1))]


def together(*shapes: Shape) -> Shape:
    before = np.cumsum([0, *(len(vertices) for vertices, _ in shapes)])
    faces = [faces + count for (_, faces), count in zip(shapes, before, strict=False)]
    return np.concatenate([vertices for vertices, _ in shapes]), np.concatenate(faces)


def moved(shape: Shape, *by_mm: float) -> Shape:
    return shape[0] + np.array(by_mm), shape[1]


def mirrored(shape: Shape) -> Shape:
    return shape[0] * [1, -1, 1], np.ascontiguousarray(shape[1][:, ::-1])


def box(*extents: float) -> Shape:
    mesh = trimesh.creation.box(extents=extents)
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, 20.0)
    return np.asarray(vertices), np.asarray(faces, np.int32)


def ball(*half_axes: float) -> Shape:
    mesh = trimesh.creation.icosphere(subdivisions=3)
    return np.asarray(mesh.vertices) * half_axes, np.asarray(mesh.faces, np.int32)


def hand(*arm: tuple[float, float, float]) -> Shape:
    """Palm, thumb and fingers on a table, an arm from the wrist through the points of `arm`: mm."""
    palm = [((60.0, y, 0.0), (95.0, 1.1 * y, 0.0), 13.0) for y in (-30.0, -10.0, 10.0, 30.0)]
    tips = ((165.0, 40.0), (180.0, 13.0), (172.0, -15.0), (150.0, -42.0))
    fingers = [((95.0, y, 0.0), (*tip, 0.0), 8.0) for tip, y in zip(tips, (30.0, 10.0, -10.0, -30.0), strict=True)]
    fingers.append(((60.0, 35.0, 0.0), (105.0, 80.0, 0.0), 10.0))
    wrist = [(a, b, 26.0) for a, b in zip([(40.0, 0.0, 0.0), *arm], arm, strict=False)]
    low, step = np.array([-120.0, -80.0, -40.0]), 4.0
    grid = np.stack(np.meshgrid(*(low[k] + step * np.arange(n) for k, n in enumerate((85, 48, 45))), indexing="ij"), -1)
    distances = []
    for start, end, radius in [*palm, *fingers, *wrist]:
        a, b = np.array(start), np.array(end)
        along = np.clip((grid - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        distances.append(np.linalg.norm(grid - a - along[..., None] * (b - a), axis=-1) - radius)
    vertices, faces, _, _ = marching_cubes(np.min(distances, axis=0), 0.0)
    return vertices * step + low, np.asarray(faces, np.int32)


NO_FEET: dict[str, tuple[Callable[[], Shape], str]] = {
    "block as long as a foot": (lambda: box(260, 95, 60), "round or a block without hollows"),
    "long block": (lambda: box(300, 60, 60), "round or a block without hollows|mm long and"),
    "sphere": (lambda: ball(100, 100, 100), "mm long and .* mm broad"),
    "hand-sized blob": (lambda: ball(95, 45, 20), "round or a block"),
    "hand": (lambda: hand((-60, 0, 0)), "gaps from side to side where a foot has its ball"),
    "two feet side by side": (lambda: together(whole(), moved(whole(), 0, 130, 0)), "2 separate bodies"),
    "heel to toe": (lambda: together(whole(), moved(whole(), 270, 0, 0)), "2 separate bodies"),
    "two feet through each other": (lambda: together(whole(), moved(whole(), 0, 60, 0)), "expected a foot"),
    "foot and plate": (lambda: together(whole(), moved(box(400, 200, 5), 130, 0, -3)), "2 separate bodies"),
    "medial half": (lambda: part(lambda middle: middle[:, 1] > 5), "expected a foot"),
    "100 times a foot": (lambda: (whole()[0] * 100, whole()[1]), "2.62e\\+04 long, expected a foot of 100 to 380 mm"),
    "12 triangles": (
        lambda: (np.asarray(trimesh.creation.box().vertices) * 200, np.asarray(trimesh.creation.box().faces, np.int32)),
        "12 triangles, expected a foot of at least 40",
    ),
}


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Exit status, standard output and the lines of standard error of `footscan measure ARGUMENTS`."""

    def run(*arguments: object) -> tuple[int, str, list[str]]:
        capsys.readouterr()
        status = run_command(["measure", *map(str, arguments)])
        said = capsys.readouterr()
        return status, said.out, said.err.splitlines()

    return run


def written(shape: Shape, file: Path) -> Path:
    trimesh.Trimesh(*shape, process=False).export(file)
    return file


@pytest.mark.parametrize(("shape", "problem"), NO_FEET.values(), ids=NO_FEET.keys())
def test_no_foot_is_refused_in_one_line(run: Run, tmp_path: Path, shape: Callable[[], Shape], problem: str) -> None:
    file = written(shape(), tmp_path / "mesh.ply")
    status, out, lines = run(file, "--json")
    assert (status, out, len(lines)) == (2, "", 1), (lines, out[:500])
    assert lines[0].startswith(f"footscan: {file}: the surface ")
    assert re.search(problem, lines[0])


CUT: dict[str, tuple[Callable[[], Shape], str]] = {
    "without toes": (lambda: part(lambda middle: middle[:, 0] < 200), "toes"),
    "tips of toes cut": (lambda: part(lambda middle: middle[:, 0] < 240), "toes"),
    "rear half": (lambda: part(lambda middle: middle[:, 0] < 140), "toes"),
    "toes cut and closed": (
        lambda: (np.column_stack([np.minimum(whole()[0][:, 0], 225), whole()[0][:, 1:]]), whole()[1]),
        "toes",
    ),
    "without a heel": (lambda: part(lambda middle: middle[:, 0] > 40), "heel"),
}


@pytest.mark.parametrize(("shape", "missing"), CUT.values(), ids=CUT.keys())
def test_a_cut_foot_is_measured_as_far_as_it_goes(
    run: Run, tmp_path: Path, shape: Callable[[], Shape], missing: str
) -> None:
    file = written(shape(), tmp_path / "mesh.ply")
    status, printed, lines = run(file, "--json", "--side", "right")
    assert status == 0
    assert f"{file}: the foot is cut off or open at the {missing}" in lines
    measures = Measures.model_validate_json(printed).measures
    assert measures["foot_length"].status == ("uncertain" if missing == "toes" else "incomplete")
    assert measures["foot_length"].note is not None
    assert missing in measures["foot_length"].note
    assert any(measure.value is not None for measure in measures.values())


def test_both_feet_of_a_mesh_are_measured_as_a_pair(run: Run, tmp_path: Path) -> None:
    file = written(together(whole(), moved(mirrored(whole()), 0, 130, 0)), tmp_path / "pair.ply")
    status, printed, lines = run(file, "--json", "--out", tmp_path / "m.json", "--csv", tmp_path / "m.csv")
    assert (status, lines) == (0, [f"{file}: the surface holds two feet, which are measured as a pair"])
    for side, content in json.loads(printed).items():
        measures = Measures.model_validate(content)
        assert measures == Measures.model_validate_json((tmp_path / f"m-{side}.json").read_bytes())
        assert measures.side == side
        for name in LENGTHS:
            assert measures.measures[name].value == pytest.approx(known_foot().measures[name], abs=0.5)
    assert [row[1] for row in csv.reader((tmp_path / "m.csv").read_text().splitlines())] == ["side", "left", "right"]
    assert run(file, "--side", "left")[0] == 2


def test_broken_files_are_refused_in_one_line(run: Run, tmp_path: Path) -> None:
    good = written(whole(), tmp_path / "good.ply").read_bytes()
    broken = {
        "text.stl": b"a text\n" * 50,
        "text.ply": b"a text\n" * 50,
        "text.obj": b"a text\n" * 50,
        "empty.stl": b"",
        "empty.ply": b"",
        "empty.obj": b"",
        "short.ply": good[: len(good) // 2],
        "short.stl": written(whole(), tmp_path / "good.stl").read_bytes()[:-7],
        "points.ply": trimesh.PointCloud(whole()[0]).export(file_type="ply"),
        "nan.ply": written(
            (np.where(whole()[0] > 100, np.nan, whole()[0]), whole()[1]), tmp_path / "n.ply"
        ).read_bytes(),
    }
    for name, content in broken.items():
        file = tmp_path / name
        file.write_bytes(content)
        status, out, lines = run(file)
        assert (status, out, len(lines)) == (2, "", 1), name
        assert lines[0].startswith(f"footscan: {file}: ")


def test_a_foot_in_a_bad_state_is_measured_all_the_same(run: Run, tmp_path: Path) -> None:
    """Triangles look anyhow, some have no area; in cm, far from the origin, on a plate of two triangles."""
    vertices, faces = whole()
    turned = np.random.default_rng(3).random(len(faces)) < 0.3
    plate = np.array([[-70.0, -100, 0], [330, -100, 0], [330, 100, 0], [-70, 100, 0]])
    shape = together(
        (vertices, np.where(turned[:, None], faces[:, ::-1], faces)),
        (vertices[:9], np.repeat(np.arange(9, dtype=np.int32)[:, None], 3, axis=1)),
        (plate, np.array([[0, 1, 2], [0, 2, 3]], np.int32)),
    )
    file = written(((shape[0] + [1e4, 0, 0]) / 10, shape[1]), tmp_path / "bad.obj")
    out = tmp_path / "measures.json"
    status, printed, lines = run(file, "--json", "--side", "left", "--out", out)
    assert status == 0
    assert lines == [
        f"{file}: a flat part under the foot, the floor, was left out",
        f"{file}: {np.count_nonzero(turned)} triangles faced against their neighbours and were turned over",
        f"{file}: coordinates in cm, inferred from the length of 26.2, were multiplied by 10 to obtain mm",
        f"{file}: toes and ball look like those of a right foot",
    ]
    assert json.loads(printed) == json.loads(out.read_bytes())
    measures = Measures.model_validate_json(printed)
    assert measures.side == "left"
    right = Measures.model_validate_json(run(file, "--json")[1])
    for name in LENGTHS:
        assert right.measures[name].value == pytest.approx(known_foot().measures[name], abs=0.5)


def test_coordinates_that_were_rounded_are_told(run: Run, tmp_path: Path) -> None:
    vertices, faces = whole()
    file = written(((vertices + np.array([1e7, 0, 0])).astype(np.float32), faces), tmp_path / "far.ply")
    status, _, lines = run(file)
    assert (status, lines) == (
        0,
        [f"{file}: the surface lies so far from the origin that its coordinates are rounded by up to 0.6 mm"],
    )


def test_a_unit_that_cannot_be_is_refused(run: Run, tmp_path: Path) -> None:
    file = written(whole(), tmp_path / "foot.ply")
    for unit, millimetres in (("cm", "2.62e+03"), ("m", "2.62e+05"), ("in", "6.66e+03")):
        problem = f"the surface is 262 long, which is {millimetres} mm if in {unit}, expected a foot of 100 to 380 mm"
        assert run(file, "--unit", unit) == (2, "", [f"footscan: {file}: {problem}"])


def test_a_table_grows_by_a_row_a_foot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    foot = make_foot(side="left", resolution_mm=4.0)
    table, first, second = tmp_path / "feet.csv", tmp_path / "one.stl", tmp_path / "two.stl"
    for file in (first, second):
        write_stl(file, foot.vertices, foot.faces)
    for file in (first, second, first):
        assert run_command(["measure", str(file), "--csv", str(table)]) == 0
    header, *rows = csv.reader(table.read_text().splitlines())
    assert header[:4] == ["file", "side", "axis", "foot_length_mm"]
    assert [row[0] for row in rows] == [str(second), str(first)]
    assert rows[0][1:] == rows[1][1:]
    capsys.readouterr()
    table.write_text("x,y\n1,2\n")
    assert run_command(["measure", str(first), "--csv", str(table)]) == 2
    assert "has another header" in capsys.readouterr().err
    assert table.read_text() == "x,y\n1,2\n"


def test_outputs_have_a_file_each_and_a_picture_is_png(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    both = str(tmp_path / "both")
    assert run_command(["measure", "foot.stl", "--out", both, "--csv", both]) == 2
    assert "stands for two outputs" in capsys.readouterr().err
    assert run_command(["measure", "foot.stl", "--picture", "foot.jpg"]) == 2
    assert "expected a name that ends with .png" in capsys.readouterr().err
