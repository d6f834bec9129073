import os
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from footscan.mesh.formats.files import mesh_bytes, read_file, read_mesh, read_points, read_shape
from footscan.mesh.formats.ply import ply_of
from footscan.mesh.formats.stl import stl_bytes
from footscan.mesh.mesh import Mesh
from schemas.base.errors import RefusedInput

VERTICES = np.array([[0.0, 0, 0], [10, 0, 0], [0, 20, 0], [0, 0, 30]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], np.int32)
UPWARDS = np.tile([0.0, 0.0, 1.0], (4, 1))
CLOUD = Mesh(VERTICES, FACES[:0], UPWARDS, camera=np.array([1, 2, 3, 8], np.uint8))


def refused(path: Path, problem: str) -> None:
    with pytest.raises(RefusedInput, match=problem) as caught:
        read_shape(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_stl_is_laid_out_to_the_letter() -> None:
    content = stl_bytes(VERTICES, FACES[:1], "footscan unit=mm side=right")
    assert len(content) == 84 + 50
    assert content[:80].rstrip(b"\0") == b"footscan unit=mm side=right"
    assert struct.unpack("<I12fH", content[80:]) == (1, 0, 0, -1, 0, 0, 0, 0, 20, 0, 10, 0, 0, 0)


@pytest.mark.parametrize("header", ["solid foot", "x" * 81])
def test_stl_header_that_misleads_readers(header: str) -> None:
    with pytest.raises(ValueError, match="STL header"):
        stl_bytes(VERTICES, FACES, header)


def test_a_second_reader_reads_our_stl(tmp_path: Path) -> None:
    path = tmp_path / "foot.stl"
    path.write_bytes(stl_bytes(VERTICES, FACES, "footscan unit=mm"))
    mesh = trimesh.load_mesh(path)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(10 * 20 * 30 / 6)


def test_a_second_reader_reads_our_cloud(tmp_path: Path) -> None:
    path = tmp_path / "cloud.ply"
    path.write_bytes(ply_of(CLOUD))
    header = path.read_bytes().partition(b"end_header")[0].decode().splitlines()
    assert header[:3] == ["ply", "format binary_little_endian 1.0", "comment unit mm"]
    assert header[-1] == "property uchar camera"
    cloud = trimesh.load(path)
    np.testing.assert_array_equal(cloud.vertices, VERTICES)
    np.testing.assert_array_equal(cloud.metadata["_ply_raw"]["vertex"]["data"]["camera"], [1, 2, 3, 8])
    np.testing.assert_array_equal(read_points(path), VERTICES)


def test_a_comment_cannot_break_the_header() -> None:
    header = ply_of(replace(CLOUD, metadata={"scan": "a\nelement vertex 9"})).partition(b"end_header")[0]
    assert header.count(b"\nelement vertex") == 1


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "ply", "ply_ascii", "obj"])
def test_meshes_of_a_second_writer(tmp_path: Path, kind: str) -> None:
    mesh = trimesh.Trimesh(VERTICES, FACES, process=False)
    path = tmp_path / f"mesh.{kind[:3]}"
    options = {"encoding": "ascii"} if kind == "ply_ascii" else {}
    content = mesh.export(file_type=kind if kind == "stl_ascii" else kind[:3], **options)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    vertices, faces = read_mesh(path)
    assert vertices.shape == (4, 3)
    assert trimesh.Trimesh(vertices, faces, process=False).volume == pytest.approx(1000)


def test_polygons_and_negative_numbers_of_obj(tmp_path: Path) -> None:
    path = tmp_path / "quad.obj"
    path.write_text("# a square\nv 0 0 0\nv 1 0 0 0.5\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\nf -4 -3 -2\n")
    vertices, faces = read_mesh(path)
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 2]]
    assert len(vertices) == 4


def test_big_endian_ply_with_other_elements_and_quads(tmp_path: Path) -> None:
    path = tmp_path / "quad.ply"
    header = (
        "ply\nformat binary_big_endian 1.0\ncomment x\nelement camera 1\nproperty double f\n"
        "element vertex 4\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\n"
        "element face 1\nproperty list uchar int vertex_indices\nproperty uchar flag\nend_header\n"
    )
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    body = struct.pack(">d", 4.0) + b"".join(struct.pack(">dddB", *corner, 7) for corner in corners)
    path.write_bytes(header.encode() + body + struct.pack(">B4iB", 4, 0, 1, 2, 3, 9))
    vertices, faces = read_mesh(path)
    np.testing.assert_array_equal(vertices, corners)
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_what_is_known_of_a_mesh_comes_back(tmp_path: Path) -> None:
    known = Mesh(
        VERTICES,
        FACES,
        UPWARDS,
        colours=np.array([[0, 1, 2], [10, 20, 30], [255, 0, 0], [1, 1, 1]], np.uint8),
        camera=np.array([0, 3, 255, 8], np.uint8),
        filled=np.array([True, False, False, True]),
        metadata={"unit": "mm", "patient": "P0001", "side": "left", "software": "footscan 0.1.0"},
    )
    (tmp_path / "foot.ply").write_bytes(mesh_bytes(known, ".ply"))
    found = read_file(tmp_path / "foot.ply")
    for name in ("vertices", "faces", "normals", "colours", "camera", "filled"):
        np.testing.assert_array_equal(getattr(found, name), getattr(known, name))
        assert getattr(found, name).dtype == getattr(known, name).dtype
    assert found.metadata == known.metadata
    (tmp_path / "foot.obj").write_bytes(mesh_bytes(known, ".obj"))
    np.testing.assert_array_equal(read_file(tmp_path / "foot.obj").colours, known.colours)
    (tmp_path / "foot.stl").write_bytes(mesh_bytes(known, ".stl"))
    assert read_file(tmp_path / "foot.stl").metadata == {
        "unit": "mm",
        "side": "left",
        "patient": "P0001",
        "software": "footscan_0.1.0",
    }


def test_colours_of_text_and_of_shares(tmp_path: Path) -> None:
    path = tmp_path / "text.ply"
    properties = "".join(
        f"property {kind} {name}\n"
        for kind, name in [*(("float", c) for c in "xyz"), *(("float", c) for c in ("red", "green", "blue"))]
    )
    path.write_text(
        f"ply\nformat ascii 1.0\nelement vertex 2\n{properties}end_header\n0 0 0 255 0 128\n1 1 1 7 300 nan\n"
    )
    assert read_file(path).colours.tolist() == [[255, 0, 128], [7, 255, 0]]
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex 1\n{properties}end_header\n0 0 0 1 0 0.5\n")
    assert read_file(path).colours.tolist() == [[255, 0, 128]]


def test_another_unit(tmp_path: Path) -> None:
    path = tmp_path / "foot.ply"
    path.write_bytes(mesh_bytes(Mesh(VERTICES, FACES, metadata={"unit": "m"}), ".ply"))
    refused(path, "unit: is in 'm', expected mm")


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "foot.stl")
    refused(tmp_path / "foot.stl", "expected a file")


def test_a_cloud_is_no_mesh(tmp_path: Path) -> None:
    path = tmp_path / "cloud.ply"
    path.write_bytes(ply_of(CLOUD))
    with pytest.raises(RefusedInput, match="no triangles"):
        read_mesh(path)


def test_missing_and_unknown_files(tmp_path: Path) -> None:
    refused(tmp_path / "none.stl", "no such file")
    (tmp_path / "foot.step").write_text("x")
    refused(tmp_path / "foot.step", r"expected a file that ends in \.stl, \.ply, \.obj")
    (tmp_path / "folder.stl").mkdir()
    refused(tmp_path / "folder.stl", "expected a file")


STL = stl_bytes(VERTICES, FACES, "footscan")
PLY = b"ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n"


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("a.stl", b"", "0 bytes"),
        ("a.stl", STL[:-1], "283 bytes, expected 284 for its 4 triangles"),
        ("a.stl", STL + b"x", "285 bytes"),
        ("a.stl", STL[:80] + b"\xff\xff\xff\xff" + STL[84:], "4294967295 triangles"),
        ("a.stl", STL[:80] + b"\0\0\0\0", "no points"),
        ("a.stl", b"solid foot\nfacet\nvertex 1 2\nendsolid", "three vertices"),
        ("a.stl", b"solid foot\nvertex 1 2 x\nvertex 1 2 3\nvertex 1 2 3\nendsolid", "could not convert"),
        ("a.stl", b"solid foot\nendsolid", "no points"),
        ("a.stl", b"solid \xff\xfe", "without 'endsolid'"),
        ("a.stl", b"a letter", "does not begin with 'solid'"),
        ("a.stl", STL[:96] + struct.pack("<f", np.nan) + STL[100:], "no numbers"),
        ("a.obj", b"v 1 2\n", "2 coordinates"),
        ("a.obj", b"v 1 2 inf\n", "no numbers"),
        ("a.obj", b"v 0 0 0\nf 1 2 3\n", "vertices that do not exist"),
        ("a.obj", b"v 0 0 0\nf 1 1 99999999999999999999999\n", "too large"),
        ("a.obj", b"f x y z\n", "invalid literal"),
        ("a.obj", b"\xff\xd8\xff\xe0 a photograph", "no points"),
        ("a.ply", b"", "expected a header"),
        ("a.ply", b"ply\nformat binary_middle_endian 1.0\nend_header\n", "binary_middle_endian"),
        ("a.ply", PLY % 3 + b"end_header\n0 0 0\n1 1 1", "ends after 2 lines"),
        ("a.ply", PLY % 2 + b"end_header\n0 0\n1 1 1\n", "too few values"),
        ("a.ply", PLY % 999999 + b"end_header\n0 0 0\n", "expected 999999"),
        ("a.ply", PLY.replace(b"ascii", b"binary_little_endian") % 999999 + b"end_header\n0", "expected more"),
        ("a.ply", PLY.replace(b"float z", b"float w") % 0 + b"end_header\n", "vertices without z"),
        ("a.ply", PLY % 0 + b"end_header\n", "no points"),
        ("a.ply", PLY % 1 + b"property quaternion q\nend_header\n0 0 0 0\n", "unknown header line"),
        ("a.ply", b"ply\nformat ascii 1.0\nproperty float x\nend_header\n", "unknown header line"),
        ("a.ply", PLY % 0 + b"property float x\nend_header\n", "is listed twice"),
    ],
)
def test_broken_files_are_refused_in_one_line(tmp_path: Path, name: str, content: bytes, problem: str) -> None:
    (tmp_path / name).write_bytes(content)
    refused(tmp_path / name, problem)


def test_random_damage_never_crashes(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    mesh = trimesh.Trimesh(VERTICES, FACES, process=False)
    sources = {"stl": STL, "ply": mesh.export(file_type="ply"), "obj": mesh.export(file_type="obj").encode()}
    for suffix, content in sources.items():
        for _ in range(150):
            damaged = np.frombuffer(content, np.uint8).copy()
            damaged[random.integers(0, len(damaged), 3)] = random.integers(0, 256, 3)
            path = tmp_path / f"damaged.{suffix}"
            path.write_bytes(damaged[: random.integers(1, len(damaged) + 1)].tobytes())
            try:
                vertices, faces = read_shape(path)
            except RefusedInput:
                continue
            assert faces.size == 0 or faces.max() < len(vertices)
