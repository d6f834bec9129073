"""Hostile files of every kind are refused within 10 s and 1 GB, in one line that says what was expected."""

import json
import os
import shutil
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bounded import BYTES, SECONDS, BoundedCommand

PLY = (
    "ply\nformat {form} 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {faces}\nproperty list {length} {value} vertex_indices\nend_header\n"
)
BINARY = "binary_little_endian"
INFINITE = struct.pack("<f", float("inf"))


def chart(rows: int) -> bytes:
    lines = (f"1,P{n},0,{n % 97},{n % 89},{300 + n % 97},{200 + n % 89}" for n in range(rows))
    return "\n".join(["camera,point,x_mm,y_mm,z_mm,i,j", *lines, ""]).encode()


def polygon(corners: int) -> bytes:
    return (
        b"v 0 0 0\nv 9 0 0\nv 0 9 0\n" * (corners // 3)
        + b"f "
        + b" ".join(b"%d" % n for n in range(1, corners))
        + b"\n"
    )


def ply(body: bytes, form: str = BINARY, faces: int = 1, length: str = "uchar", value: str = "int") -> bytes:
    vertex = bytes(12) if form == BINARY else b"0 0 0\n"
    return PLY.format(form=form, faces=faces, length=length, value=value).encode() + vertex + body


def png(columns: int, rows: int) -> bytes:
    packed = zlib.compressobj(9)
    data = b"".join(packed.compress(bytes(1 + 3 * columns)) for _ in range(rows)) + packed.flush()

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def measures(count: int, version: str = "1") -> bytes:
    told = {f"measure_{n:06}": {"value": n % 500} for n in range(count)}
    return json.dumps({"format": f"footscan.measures/{version}", "side": "left", "measures": told}).encode()


def far(text: str) -> bytes:
    return "".join(f"v {x} {y} {z}\n" for x in (0, text) for y in (0, text) for z in (0, text)).encode() + (
        b"f 1 2 3\nf 1 2 4\nf 2 3 5\nf 5 6 7\nf 6 7 8\n"
    )


MAP = "map c.json {} --camera 1"
CASES: dict[str, tuple[str, str, Callable[[], bytes], str]] = {
    "chart": ("calibrate chart {}", "a.csv", lambda: chart(40_000), "chart_points=N raises it"),
    "models of a chart": ("calibrate models {}", "a.csv", lambda: chart(40_000), "chart_points=N raises it"),
    "polygon": ("export {} --out b.stl", "a.obj", lambda: polygon(1_000_000), "polygon_corners=N raises it"),
    "empty lists": ("compare {} {}", "a.ply", lambda: ply(bytes(99_000_000), faces=99_000_000), "mesh_rows=N raises"),
    "infinite length": ("measure {}", "a.ply", lambda: ply(INFINITE * 4, length="float"), "property list float int"),
    "infinite index": ("measure {}", "a.ply", lambda: ply(b"\4" + INFINITE * 4, value="float"), "infinite"),
    "infinite triangle": ("measure {}", "a.ply", lambda: ply(b"\3" + INFINITE * 3, value="float"), "too large for a"),
    "infinite index in text": ("measure {}", "a.ply", lambda: ply(b"3 0 inf 1\n", "ascii"), "infinite"),
    "infinite length in text": ("measure {}", "a.ply", lambda: ply(b"inf 0 1\n", "ascii"), "is no proper PLY file"),
    "STL of forged count": ("measure {}", "a.stl", lambda: bytes(80) + b"\xff" * 4 + bytes(50), "4294967295 triangles"),
    "image of 169 megapixels": ("extract {}", "a.png", lambda: png(13_000, 13_000), "image_pixels=N raises it"),
    "60 MB of blank lines": (MAP, "a.csv", lambda: b"i,j\n" + b"\n" * 60_000_000, "table_bytes=N raises it"),
    "30 MB of blank lines": (MAP, "a.csv", lambda: b"i,j\n" + b"\n" * 30_000_000, "table_rows=N raises it"),
    "100,000 measures": ("pair {} {}", "a.json", lambda: measures(100_000), "measures=N raises it"),
    "1e308": ("measure {}", "a.obj", lambda: far("1e308"), "expected mm"),
    "1e308, exported": ("export {} --out b.stl", "a.obj", lambda: far("1e308"), "expected mm"),
    "1e200, compared": ("compare {} {}", "a.obj", lambda: far("1e200"), "expected mm"),
    "pixels of 1e308": (MAP, "a.csv", lambda: b"i,j\n1e308,1e308\n", "expected a number of pixels"),
    "future version": ("sizes {}", "a.json", lambda: measures(1, "2"), "a newer footscan wrote it"),
    "many values": ("sizes {}", "a.json", lambda: b'{"a":[' + b"1," * 3_000_000 + b"1]}", "json_values=N raises it"),
    "deep JSON": ("sizes {}", "a.json", lambda: b"[" * 7_000_000, "expected a JSON document"),
    "long integer": ("sizes {}", "a.json", lambda: b'{"a":' + b"9" * 5000 + b"}", "expected a JSON document"),
    "many unknown fields": ("plan {}", "a.yaml", lambda: b"".join(b"n%05d: 1\n" % n for n in range(25_000)), "unknown"),
    "a long name": ("plan {}", "a.yaml", lambda: b"n" * 900 + b": 1\n", "unknown field"),
    "many mistakes": (
        "calibrate show {}",
        "a.json",
        lambda: b'{"format":"footscan.calibration/3","cameras":[' + b"1," * 490_000 + b"1]}",
        "expected",
    ),
}


@pytest.fixture(scope="module")
def bounded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BoundedCommand]:
    command = BoundedCommand(tmp_path_factory.mktemp("told"))
    yield command
    command.close()


@pytest.mark.parametrize("name", CASES)
def test_a_hostile_file_is_refused_within_bounds(
    bounded: BoundedCommand, pristine: Path, tmp_path: Path, name: str
) -> None:
    arguments, file, content, told = CASES[name]
    (tmp_path / file).write_bytes(content())
    (tmp_path / "c.json").write_bytes((pristine / "calibration.json").read_bytes())
    refuse(bounded, [part.format(file) for part in arguments.split()], tmp_path, told)


@pytest.mark.parametrize(
    ("file", "size", "arguments", "told"),
    [
        ("a.png", 6 * 10**9, ["extract", "a.png"], "FOOTSCAN_LIMITS=image_bytes="),
        ("film/0.png", 6 * 10**9, ["extract", "film"], "FOOTSCAN_LIMITS=image_bytes="),
        ("a.stl", 4 * 10**9, ["measure", "a.stl"], "FOOTSCAN_LIMITS=mesh_bytes="),
        ("a.json", 4 * 10**9, ["calibrate", "show", "a.json"], "FOOTSCAN_LIMITS=json_bytes="),
        ("a.csv", 4 * 10**9, ["calibrate", "chart", "a.csv"], "FOOTSCAN_LIMITS=table_bytes="),
        ("workflow.yaml", 6_700_000, ["plan"], "FOOTSCAN_LIMITS=yaml_bytes="),
        ("array/zarr.json", 4 * 10**9, ["extract", "array"], "FOOTSCAN_LIMITS=json_bytes="),
    ],
)  # fmt: skip
def test_a_sparse_file_is_not_read(
    bounded: BoundedCommand, tmp_path: Path, file: str, size: int, arguments: list[str], told: str
) -> None:
    path = tmp_path / file
    path.parent.mkdir(exist_ok=True)
    path.touch()
    os.truncate(path, size)
    refuse(bounded, arguments, tmp_path, told)


@pytest.mark.parametrize(("size", "told"), [(3 * 10**9, "image_bytes="), (0, "film_chunks=")])
def test_an_avi_of_one_huge_frame_or_of_endless_empty_ones(
    bounded: BoundedCommand, pristine: Path, tmp_path: Path, size: int, told: str
) -> None:
    film = bytearray((pristine / "archive/P0001/S1/cam1.avi").read_bytes())
    movi = film.index(b"movi")
    total = 3_500_000_000
    film[4:8] = (total - 8).to_bytes(4, "little")
    film[movi - 4 : movi] = (total - movi).to_bytes(4, "little")
    film[movi + 4 : movi + 12] = b"00dc" + size.to_bytes(4, "little")
    path = tmp_path / "a.avi"
    path.write_bytes(film[: movi + 12])
    os.truncate(path, total)
    refuse(bounded, ["extract", "a.avi"], tmp_path, f"FOOTSCAN_LIMITS={told}")


def test_as_many_lists_as_are_allowed_are_read(bounded: BoundedCommand, tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_bytes(ply(b"\0\1\0\0\0\0" * 1_500_000, faces=3_000_000))
    ended = bounded.run(["verify", "sphere", "a.ply", "--diameter", "50"], tmp_path)
    assert (ended.status, ended.broken()) == (1, None)


def test_every_mistake_is_told_within_bounds(bounded: BoundedCommand, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_bytes(b"".join(b"n%05d: 1\n" % n for n in range(25_000)))
    ended = bounded.run(["config", "check", "a.yaml"], tmp_path)
    assert (ended.status, ended.broken(), ended.out.count("unknown field")) == (2, None, 100)


def test_a_forged_array_is_refused(bounded: BoundedCommand, tmp_path: Path) -> None:
    manifest = {"encoding": "image", "height": 2**62, "width": 640, "frames": ["0" * 64]}
    (tmp_path / "array").mkdir()
    (tmp_path / "array/zarr.json").write_text(json.dumps({"attributes": {"footscan": manifest, "film": None}}))
    refuse(bounded, ["extract", "array"], tmp_path, "FOOTSCAN_LIMITS=image_pixels=")


def test_a_group_of_a_foreign_store_is_refused(bounded: BoundedCommand, archive: Path) -> None:
    group = archive / "archive/P0001/S1/frames.zarr"
    group.mkdir()
    (group / "zarr.json").touch()
    os.truncate(group / "zarr.json", 4 * 10**9)
    ended = bounded.run(["ingest", "archive"], archive)
    assert ended.status == 2
    assert ended.broken() is None
    assert "FOOTSCAN_LIMITS=json_bytes=" in ended.err


def test_a_path_with_nul_is_refused(bounded: BoundedCommand, archive: Path) -> None:
    workflow = archive / "workflow.yaml"
    text = workflow.read_text()
    for name in ("archive: archive", "results: results", "calibration: calibration.json", "cache: cache"):
        key, value = name.split(": ")
        workflow.write_text(text.replace(f"{name}\n", "") + f'{key}: "{value}\\0"\n')
        for command in ("plan", "run", "config check"):
            ended = bounded.run(command.split(), archive)
            assert (ended.status, ended.broken()) == (2, None), (name, command, ended.err)
            assert f"{key}" in ended.err + ended.out
    refuse(bounded, ["measure", "a\0b"], archive, "holds a character of value 0")


def test_a_folder_without_scans_is_refused_by_ingest(bounded: BoundedCommand, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    refuse(bounded, ["ingest", "empty"], tmp_path, "empty: holds no scan, expected folders with a scan.yaml")


def test_a_log_that_is_a_folder_is_refused(bounded: BoundedCommand, archive: Path) -> None:
    refuse(bounded, ["run", "--log-json", "archive"], archive, "archive: is a folder, expected the name of a file")


def test_positions_of_blank_lines_are_refused(bounded: BoundedCommand, archive: Path) -> None:
    scan = archive / "archive/P0001/S1"
    document = scan / "scan.yaml"
    document.write_text(document.read_text().replace("file: cam1.avi", "file: cam1.avi, positions: cam1.csv"))
    (scan / "cam1.csv").write_bytes(b"frame,x_mm\n" + b"\n" * 60_000_000)
    arguments = ["run", "--scan", "archive/P0001/S1", "--calibration", "calibration.json", "--out", "out"]
    refuse(bounded, arguments, archive, "FOOTSCAN_LIMITS=table_bytes=")


def test_what_was_refused_for_a_limit_runs_when_it_is_raised(bounded: BoundedCommand, archive: Path) -> None:
    """The refusal is not kept: the limit is no input of the step."""
    arguments = ["run", "--scan", "archive/P0001/S1", "--calibration", "calibration.json", "--out", "out"]
    ended = bounded.run(arguments, archive, FOOTSCAN_LIMITS="film_frames=19")
    assert ended.status == 2
    assert "FOOTSCAN_LIMITS=film_frames=N raises it" in ended.err
    planned = bounded.run(["plan", *arguments[1:], "--json"], archive)
    assert {miss["step"] for miss in json.loads(planned.out)["misses"]} >= {"ingest", "extract"}


def test_a_limit_that_is_none_is_refused_by_every_command(bounded: BoundedCommand, tmp_path: Path) -> None:
    for arguments in (["plan"], ["measure", "a.stl"], ["cache", "show"]):
        ended = bounded.run(arguments, tmp_path, FOOTSCAN_LIMITS="mesh=1")
        assert (ended.status, ended.err.count("\n")) == (2, 1)
        assert ended.err.startswith("footscan: FOOTSCAN_LIMITS: unknown limit 'mesh'")


@pytest.fixture
def archive(pristine: Path, tmp_path: Path) -> Path:
    """A copy of the small archive, to be spoilt."""
    return Path(shutil.copytree(pristine, tmp_path / "home"))


def refuse(bounded: BoundedCommand, arguments: list[str], folder: Path, told: str) -> None:
    ended = bounded.run(arguments, folder)
    assert ended.broken() is None, ended.err[-2000:]
    assert ended.status == 2, ended.err[-2000:]
    assert told in ended.err
    assert len(ended.err) < 2000
    assert ended.seconds < SECONDS
    assert ended.peak < BYTES
