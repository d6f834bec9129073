import json
import os
import stat
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from footscan.mesh.formats.files import WRITERS, mesh_bytes, read_file
from footscan.mesh.mesh import Mesh
from pipelines.cli.main import run_command
from pipelines.version import SOFTWARE

BOX = trimesh.creation.box((100.0, 50.0, 30.0))
Told = tuple[int, str, str]
Run = Callable[..., Told]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """`footscan export ARGUMENTS`: its status, what it printed and what it said."""

    def export(*arguments: object) -> Told:
        capsys.readouterr()
        status = run_command(["export", *map(str, arguments)])
        said = capsys.readouterr()
        return status, said.out, said.err

    return export


def egg() -> Mesh:
    """260 by 90 by 70 mm, smooth, of 5120 triangles, standing on the floor."""
    ball = trimesh.creation.icosphere(4)
    vertices = np.asarray(ball.vertices) * [130.0, 45.0, 35.0]
    vertices[:, 2] -= vertices[:, 2].min()
    colours = np.full((len(vertices), 3), [200, 100, 50], np.uint8)
    camera = np.ones(len(vertices), np.uint8)
    return Mesh(vertices, np.asarray(ball.faces, np.int32), colours=colours, camera=camera, metadata={"side": "left"})


@pytest.fixture
def ply(tmp_path: Path) -> Path:
    path = tmp_path / "foot.ply"
    path.write_bytes(mesh_bytes(egg(), ".ply"))
    return path


def refused(told: Told, problem: str) -> None:
    status, printed, said = told
    assert (status, printed) == (2, "")
    assert problem in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("suffix", sorted(WRITERS))
def test_every_format_is_written_twice_alike(ply: Path, suffix: str, run: Run) -> None:
    first, second = (ply.with_name(f"{name}{suffix}") for name in ("first", "second"))
    told = [run(ply, "--out", path, "--triangles", 3000, "--json") for path in (first, second)]
    assert [status for status, _, _ in told] == [0, 0]
    assert first.read_bytes() == second.read_bytes()
    figures = json.loads(told[0][1])
    assert figures["bytes"] == first.stat().st_size
    assert figures["mesh"]["triangles"] in (3000, 2999)
    assert figures["mesh"]["open_edges"] == 0
    assert figures["metadata"] == {"side": "left", "unit": "mm", "software": SOFTWARE}
    assert 0 < figures["changed_mm"]["surface_max"] < 0.5
    assert told[0][2] == ""


def test_all_that_is_known_goes_along(ply: Path, run: Run) -> None:
    out = ply.with_name("out.ply")
    status, printed, _ = run(ply, "--out", out, "--patient", "P0007", "--scan", "today", "--side", "right")
    assert status == 0
    assert "5120" in printed
    found, given = read_file(out), egg()
    np.testing.assert_array_equal(found.vertices, given.vertices.astype(np.float32))
    np.testing.assert_array_equal(found.colours, given.colours)
    np.testing.assert_array_equal(found.camera, given.camera)
    assert found.metadata == {"unit": "mm", "side": "right", "patient": "P0007", "scan": "today", "software": SOFTWARE}
    # An egg's normal is the gradient of its equation.
    gradient = (given.vertices - [0, 0, 35]) / np.square([130.0, 45.0, 35.0])
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    assert np.sum(found.normals * gradient, axis=1).min() > 0.995


def test_more_triangles_than_there_are(ply: Path, run: Run) -> None:
    out = ply.with_name("out.stl")
    _, printed, _ = run(ply, "--out", out, "--triangles", 40000, "--json")
    assert json.loads(printed)["changed_mm"] is None
    assert read_file(out).faces.shape == (5120, 3)


def test_a_body_turned_inside_out_in_the_air(ply: Path, run: Run) -> None:
    given = egg()
    ply.write_bytes(
        mesh_bytes(replace(given, vertices=given.vertices + np.array([0, 0, 40]), faces=given.faces[:, ::-1]), ".ply")
    )
    out = ply.with_name("out.obj")
    status, _, said = run(ply, "--out", out)
    assert (status, said) == (0, f"{ply}: its lowest point is at Z = 40.0 mm; --floor sets it to 0\n")
    assert trimesh.load(out).volume > 0
    status, _, said = run(ply, "--out", out, "--floor")
    assert (status, said) == (0, "")
    np.testing.assert_allclose(trimesh.load(out).bounds[:, 2], [0, 70], atol=1e-4)


def test_what_is_open_is_told(ply: Path, run: Run) -> None:
    given = egg()
    ply.write_bytes(mesh_bytes(replace(given, faces=given.faces[1:]), ".ply"))
    status, _, said = run(ply, "--out", ply.with_name("out.3mf"))
    assert status == 0
    assert "is not closed: 3 open edges in 1 holes, and 0 edges" in said


def test_two_bodies_are_told(ply: Path, run: Run) -> None:
    given = egg()
    faces = np.concatenate([given.faces, given.faces + len(given.vertices)])
    ply.write_bytes(
        mesh_bytes(Mesh(np.concatenate([given.vertices, given.vertices + np.array([0, 200, 0])]), faces), ".ply")
    )
    _, _, said = run(ply, "--out", ply.with_name("out.stl"))
    assert said == f"{ply}: 2 parts, expected one foot\n"


def test_fewer_triangles_than_the_measures_allow(ply: Path, run: Run) -> None:
    out = ply.with_name("out.stl")
    refused(run(ply, "--out", out, "--triangles", 300), "--triangles 300: would move ends by")
    assert not out.exists()


def test_wrong_files_are_refused_in_one_line(ply: Path, run: Run) -> None:
    folder = ply.with_name("folder.stl")
    folder.mkdir()
    out = ply.with_name("out.stl")
    refused(run(ply, "--out", folder), "is a folder")
    refused(run(ply, "--out", ply), "is an input")
    refused(
        run(ply, "--out", ply.with_name("foot.step")), "expected a name that ends in .stl, .ply, .obj, .wrl, .3mf, .glb"
    )
    refused(run(ply, "--out", "/dev/stdout"), "expected a name that ends in")
    refused(run(ply.with_name("none.stl"), "--out", out), "no such file")
    refused(run(folder, "--out", out), "expected a file")
    refused(run(ply.with_name("a\nb\x1b.stl"), "--out", out), "no such file")
    refused(run(ply, "--out", out, "--patient", "../P1"), "--patient")
    refused(run(ply, "--out", out, "--triangles", 0), "--triangles")
    given = egg()
    ply.write_bytes(mesh_bytes(replace(given, faces=given.faces[:0]), ".ply"))
    refused(run(ply, "--out", out), "holds no triangles")
    ply.write_bytes(mesh_bytes(replace(given, vertices=given.vertices / 1000), ".ply"))
    refused(
        run(ply, "--out", out), "is 0.284 across, expected 20 to 2000 mm, in mm"
    )  # (260² + 90² + 70²) ** 0.5 / 1000
    assert not out.exists()


def test_a_folder_that_is_none_is_a_fault(ply: Path, run: Run) -> None:
    status, printed, said = run(ply, "--out", ply / "out.stl")
    assert (status, printed) == (3, "")
    assert "cannot be written" in said


def test_a_pipe_is_written_into(ply: Path, run: Run) -> None:
    pipe = ply.with_name("pipe.glb")
    os.mkfifo(pipe)
    ply.write_bytes(mesh_bytes(Mesh(BOX.vertices, BOX.faces), ".ply"))
    end = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        assert run(ply, "--out", pipe)[0] == 0
        assert os.read(end, 4096)[:4] == b"glTF"
    finally:
        os.close(end)
    assert stat.S_ISFIFO(pipe.stat().st_mode)


NAMES = {"patient": "Pt-4711", "scan": "2026-11-20-R"}


def everything_in(path: Path) -> bytes:
    """What a file says, of a zip file that of its parts."""
    if path.suffix != ".3mf":
        return path.read_bytes()
    with zipfile.ZipFile(path) as package:
        return b"".join(part.filename.encode() + package.read(part) for part in package.infolist())


@pytest.mark.parametrize("suffix", sorted(WRITERS))
def test_an_anonymous_file_names_nobody(ply: Path, suffix: str, run: Run) -> None:
    named = {**egg().metadata, **NAMES, "frame": "scanner"}
    data = mesh_bytes(replace(egg(), metadata=named), ".ply").replace(
        b"comment unit mm", b"comment unit mm\ncomment operator Smith\ncomment file /films/smith/2026-11-20/foot.ply"
    )
    ply.write_bytes(data)
    out, known = ply.with_name(f"out{suffix}"), ply.with_name(f"known{suffix}")
    status, printed, _ = run(ply, "--out", known, "--json")
    assert (status, json.loads(printed)["metadata"]["patient"]) == (0, NAMES["patient"])
    assert NAMES["patient"].encode() in everything_in(known)
    status, printed, _ = run(ply, "--out", out, "--anonymous", "--json")
    told = {"side": "left", "frame": "scanner", "unit": "mm", "software": SOFTWARE}
    assert (status, json.loads(printed)["metadata"]) == (0, told)
    for word in (*NAMES.values(), "smith", "/films", str(ply.parent)):
        assert word.lower().encode() not in everything_in(out).lower()
    assert b"left" in everything_in(out)
    if suffix in (".ply", ".obj"):
        found = read_file(out)
        assert (found.colours, read_file(known).colours is None) == (None, False)
        np.testing.assert_allclose(found.vertices, egg().vertices, atol=1e-4)
    assert all(word not in everything_in(out) for word in (b"COLOR_0", b"m:color", b"Color {", b"uchar red"))


def test_the_name_of_an_anonymous_file(ply: Path, run: Run) -> None:
    ply.write_bytes(mesh_bytes(replace(egg(), metadata=NAMES), ".ply"))
    refused(run(ply, "--out", ply.with_name("foot-of-pt-4711.stl"), "--anonymous"), "has 'Pt-4711' in its name")
    refused(run(ply, "--out", ply.with_name("out.stl"), "--anonymous", "--patient", "P1"), "excludes --patient")
    ply.write_bytes(mesh_bytes(replace(egg(), metadata={"side": "Smith", "frame": "of Smith"}), ".ply"))
    out = ply.with_name("out.stl")
    assert json.loads(run(ply, "--out", out, "--anonymous", "--json")[1])["metadata"] == {
        "unit": "mm",
        "software": SOFTWARE,
    }
    results = ply.parent / "results/P0042/visit-R"
    results.mkdir(parents=True)
    (results / "measures.json").touch()
    (results / "foot.ply").write_bytes(mesh_bytes(egg(), ".ply"))
    refused(
        run(results / "foot.ply", "--out", ply.with_name("visit-R.stl"), "--anonymous"), "has 'visit-R' in its name"
    )
    assert run(results / "foot.ply", "--out", ply.with_name("foot.stl"), "--anonymous")[0] == 0
    assert run(results / "foot.ply", "--out", ply.with_name("visit-R.stl"))[0] == 0
