"""Each format, as another library reads it. Positions are compared to the last digit of single precision."""

import io
from dataclasses import replace
from pathlib import Path

import lib3mf
import numpy as np
import pymeshlab
import pytest
import trimesh

from footscan.mesh.formats.files import WRITERS, mesh_bytes
from footscan.mesh.mesh import Mesh, with_normals

METADATA = {"patient": "P0001", "scan": '2026 "R" <&\\', "side": "right", "software": "footscan 1.2"}
KINDS = sorted(WRITERS)


@pytest.fixture(scope="module")
def ball() -> Mesh:
    """An egg of 80 by 60 by 40 mm, off the origin, with all that is known of its vertices."""
    sphere = trimesh.creation.icosphere(2)
    vertices = np.asarray(sphere.vertices) * [40.0, 30.0, 20.0] + [123.456, -7.0, 20.0]
    count = np.arange(len(vertices))
    plain = Mesh(
        vertices,
        np.asarray(sphere.faces, np.int32),
        colours=np.column_stack([count, 255 - count, count // 2]).astype(np.uint8),
        camera=(count % 9).astype(np.uint8),
        filled=count % 9 == 0,
        metadata=METADATA,
    )
    return with_normals(plain)


def single(values: np.ndarray) -> np.ndarray:
    return np.asarray(values, np.float32)


def read(mesh: Mesh, kind: str) -> trimesh.Trimesh:
    loaded = trimesh.load(io.BytesIO(mesh_bytes(mesh, f".{kind}")), file_type=kind, process=False)
    return loaded if isinstance(loaded, trimesh.Trimesh) else loaded.to_geometry()


def test_stl(ball: Mesh) -> None:
    content = mesh_bytes(ball, ".stl")
    # Two words are made one; the software would be letters 60 to 81 of 80.
    assert content[:80].rstrip(b"\0") == b'footscan unit=mm side=right patient=P0001 scan=2026_"R"_<&\\'
    result = read(ball, "stl")
    np.testing.assert_array_equal(single(result.vertices).reshape(-1, 3, 3), single(ball.vertices)[ball.faces])
    assert trimesh.load(io.BytesIO(content), file_type="stl").is_watertight
    outward = np.sum(result.face_normals * (result.triangles_center - [123.456, -7.0, 20.0]), axis=1)
    assert np.all(outward > 0)


def test_ply(ball: Mesh) -> None:
    result = read(ball, "ply")
    np.testing.assert_array_equal(single(result.vertices), single(ball.vertices))
    np.testing.assert_array_equal(result.faces, ball.faces)
    np.testing.assert_array_equal(single(result.vertex_normals), single(ball.normals))
    np.testing.assert_array_equal(result.visual.vertex_colors[:, :3], ball.colours)
    of_vertices = result.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_array_equal(of_vertices["camera"], ball.camera)
    np.testing.assert_array_equal(of_vertices["filled"], ball.filled)
    header = mesh_bytes(ball, ".ply").partition(b"end_header")[0].decode().splitlines()
    assert header[2:7] == [
        "comment unit mm",
        "comment patient P0001",
        'comment scan 2026 "R" <&\\',
        "comment side right",
        "comment software footscan 1.2",
    ]


def test_obj(ball: Mesh) -> None:
    result = read(ball, "obj")
    np.testing.assert_array_equal(single(result.vertices), single(ball.vertices))
    np.testing.assert_array_equal(result.faces, ball.faces)
    np.testing.assert_allclose(result.vertex_normals, ball.normals, atol=1e-6)
    np.testing.assert_array_equal(result.visual.vertex_colors[:, :3], ball.colours)
    assert mesh_bytes(ball, ".obj").startswith(b"# unit mm\n# patient P0001\n")


def test_glb(ball: Mesh) -> None:
    """Metres, Y up, and light in place of levels: half the light is level 188 of 255."""
    level = np.full((len(ball.vertices), 3), 188, np.uint8)
    content = io.BytesIO(mesh_bytes(replace(ball, colours=level), ".glb"))
    (result,) = trimesh.load_scene(content, file_type="glb", process=False, skip_materials=True).geometry.values()
    x, y, z = ball.vertices.T
    np.testing.assert_array_equal(single(result.vertices), single(np.column_stack([x, z, -y]) / 1000))
    np.testing.assert_array_equal(result.faces, ball.faces)
    assert result.units == "meters"
    assert result.volume > 0
    nx, ny, nz = ball.normals.T
    np.testing.assert_allclose(result.vertex_normals, np.column_stack([nx, nz, -ny]), atol=1e-6)
    half = round(0.5029 * 255)  # ((188 / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_array_equal(result.visual.vertex_colors, [[half, half, half, 255]] * len(level))
    np.testing.assert_array_equal(result.vertex_attributes["_CAMERA"].ravel(), ball.camera)
    np.testing.assert_array_equal(result.vertex_attributes["_FILLED"].ravel(), ball.filled)
    assert {key: result.metadata[key] for key in METADATA} == METADATA
    assert result.metadata["unit"] == "m"


def test_3mf(ball: Mesh) -> None:
    """As the 3MF Consortium's own library reads it, which takes nothing that the norm does not allow."""
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromBuffer(mesh_bytes(ball, ".3mf"))
    assert reader.GetWarningCount() == 0
    assert model.GetUnit() == lib3mf.ModelUnit.MilliMeter
    group = model.GetMetaDataGroup()
    result = [group.GetMetaData(k) for k in range(group.GetMetaDataCount())]
    entries = {entry.GetName(): entry.GetValue() for entry in result}
    assert entries["Title"] == 'P0001 2026 "R" <&\\ right'
    assert entries["Application"] == "footscan 1.2"
    assert {name: entries[name] for name in METADATA} == METADATA

    meshes = model.GetMeshObjects()
    assert meshes.Count() == 1
    meshes.MoveNext()
    foot = meshes.GetCurrentMeshObject()
    assert foot.IsManifoldAndOriented()
    assert foot.GetType() == lib3mf.ObjectType.Model
    np.testing.assert_array_equal([list(p.Coordinates) for p in foot.GetVertices()], single(ball.vertices))
    np.testing.assert_array_equal([list(t.Indices) for t in foot.GetTriangleIndices()], ball.faces)
    for number in (0, 7, 300):
        properties = foot.GetTriangleProperties(number)
        colours = model.GetColorGroupByID(properties.ResourceID)
        corners = [colours.GetColor(k) for k in properties.PropertyIDs]
        assert [[c.Red, c.Green, c.Blue] for c in corners] == ball.colours[ball.faces[number]].tolist()
        assert {c.Alpha for c in corners} == {255}


def test_3mf_a_second_time(ball: Mesh) -> None:
    result = read(ball, "3mf")
    np.testing.assert_array_equal(single(result.vertices), single(ball.vertices))
    np.testing.assert_array_equal(result.faces, ball.faces)
    assert result.units == "millimeter"


def test_3mf_of_an_open_mesh_says_so(ball: Mesh) -> None:
    model = lib3mf.get_wrapper().CreateModel()
    model.QueryReader("3mf").ReadFromBuffer(mesh_bytes(replace(ball, faces=ball.faces[1:]), ".3mf"))
    meshes = model.GetMeshObjects()
    meshes.MoveNext()
    assert meshes.GetCurrentMeshObject().GetType() == lib3mf.ObjectType.Surface


def test_vrml(ball: Mesh, tmp_path: Path) -> None:
    path = tmp_path / "foot.wrl"
    path.write_bytes(mesh_bytes(ball, ".wrl"))
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(path))
    result = meshes.current_mesh()
    np.testing.assert_array_equal(single(result.vertex_matrix()), single(ball.vertices))
    np.testing.assert_array_equal(result.face_matrix(), ball.faces)
    np.testing.assert_allclose(
        result.vertex_color_matrix()[:, :3] * 255, ball.colours, atol=1.01
    )  # it cuts, not rounds
    assert b'info [ "unit mm", "patient P0001", "scan 2026 \\"R\\" <&\\\\", "side right"' in path.read_bytes()


@pytest.mark.parametrize("kind", KINDS)
def test_a_mesh_of_which_nothing_more_is_known(ball: Mesh, kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"foot{kind}"
    path.write_bytes(mesh_bytes(Mesh(ball.vertices, ball.faces), kind))
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(path))
    if kind == ".stl":
        meshes.meshing_remove_duplicate_vertices()
    assert meshes.current_mesh().face_number() == len(ball.faces)
    assert meshes.get_topological_measures()["boundary_edges"] == 0


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_mesh_gives_the_same_bytes(ball: Mesh, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    first = mesh_bytes(ball, kind)
    monkeypatch.setattr("time.time", lambda: 2e9)
    monkeypatch.setattr("time.localtime", lambda *_: (2033, 5, 18, 3, 33, 20, 2, 138, 0))
    assert mesh_bytes(replace(ball, vertices=ball.vertices.copy()), kind) == first


@pytest.mark.parametrize("kind", KINDS)
def test_words_that_would_break_a_file(ball: Mesh, kind: str, tmp_path: Path) -> None:
    entries = {"patient": 'a\n"]}></metadata>\x00\nend_header\nv 1 2 3\n--\x1b[0m'}
    hostile = mesh_bytes(replace(ball, metadata=entries), kind)
    assert hostile.count(b"\nv 1 2 3") == hostile.count(b"\nend_header\nv") == 0
    path = tmp_path / f"foot{kind}"
    path.write_bytes(hostile)
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(path))
    assert meshes.current_mesh().face_number() == len(ball.faces)
