"""Results that change while the console serves them: one clear line, no exception, no open file."""

import json
import os
import shutil
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from stand_in import deliver_made_up
from starlette.testclient import TestClient

from pipelines.console.console import Console
from pipelines.console.server import server_of
from pipelines.console.web import listen

ADDRESS = "/foot/P1/R", "/pair/P1/L/R"
SECRET = "a secret outside the results"
NAMES = ("measures.json", "quality.json", "foot.ply", "foot.stl", "report.html", "cloud.ply")
OF_A_PAGE = {"measures.json": ADDRESS, "quality.json": ADDRESS[:1], "foot.ply": ADDRESS[:1]}
GENEROUS_SECONDS = 10.0
PLY = "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n{}end_header\n"
FACES = "element face {}\nproperty list uchar int vertex_indices\n"


@pytest.fixture
def foot(results: Path) -> Path:
    """The results of the right foot of a pair."""
    for scan, side in (("L", "left"), ("R", "right")):
        (results / "P1" / scan).mkdir(parents=True)
        deliver_made_up(results / "P1" / scan, side)
    for name in ("foot.stl", "cloud.ply"):
        (results / "P1" / "R" / name).write_bytes(b"x" * 1000)
    (results.parent / "secret").write_text(SECRET)
    return results / "P1" / "R"


def _socket(path: Path) -> None:
    before = Path.cwd()
    os.chdir(path.parent)  # the path of a socket must be short
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(path.name)
    os.chdir(before)


def _sparse(size: int) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        path.touch()
        os.truncate(path, size)

    return make


NO_FILES: dict[str, Callable[[Path], None]] = {
    "nothing": lambda _: None,
    "folder": Path.mkdir,
    "pipe": os.mkfifo,
    "socket": _socket,
    "link that leads out": lambda path: path.symlink_to("../../../secret"),
    "link to a device": lambda path: path.symlink_to("/dev/zero"),
    "link to nothing": lambda path: path.symlink_to("nowhere"),
    "link to itself": lambda path: path.symlink_to(path.name),
    "6 GB of nothing": _sparse(6 * 10**9),
}


@contextmanager
def swapped(path: Path, make: Callable[[Path], None]) -> Iterator[None]:
    """Replace a file by something else."""
    kept = path.with_name("kept")
    path.rename(kept)
    make(path)
    yield
    if path.is_dir() and not path.is_symlink():
        path.rmdir()
    kept.replace(path)


def descriptors() -> list[str]:
    """The open files of this process."""
    return sorted(file.name for file in Path("/proc/self/fd").iterdir())


@pytest.mark.parametrize("kind", NO_FILES)
@pytest.mark.parametrize("name", NAMES)
def test_what_is_no_result_any_longer_is_refused(web: TestClient, foot: Path, name: str, kind: str) -> None:
    paths = (*OF_A_PAGE.get(name, ()), f"/results/P1/R/{name}")
    for path in paths:
        assert web.get(path).status_code == 200
    with swapped(foot / name, NO_FILES[kind]):
        before = descriptors()
        for path in paths:
            began = time.monotonic()
            answer = web.get(path)
            assert answer.status_code == 404, path
            assert SECRET not in answer.text
            assert answer.text.startswith("footscan: ")
            assert answer.text.count("\n") == 1
            assert name in answer.text
            assert time.monotonic() - began < GENEROUS_SECONDS
        assert descriptors() == before
    for path in paths:
        assert web.get(path).status_code == 200


def test_a_folder_that_leads_out_is_refused(web: TestClient, foot: Path, results: Path) -> None:
    assert web.get("/foot/P1/R").status_code == 200
    outside = results.parent / "outside"
    shutil.move(foot, outside)
    foot.symlink_to(outside)
    for path in (*ADDRESS, "/results/P1/R/measures.json"):
        assert web.get(path).status_code == 404, path


def _with(**fields: Any) -> Callable[[bytes], bytes]:
    return lambda sound: json.dumps(json.loads(sound) | fields).encode()


def _value(value: float) -> Callable[[bytes], bytes]:
    return lambda sound: sound.replace(b"262.0", str(value).encode())


MANY = {f"m{k}": {"value": 1.0, "unit": "mm", "status": "ok", "definition": "x"} for k in range(50_000)}
CONTENTS: list[tuple[str, str, Callable[[bytes], bytes]]] = [
    ("measures.json", "empty", lambda _: b""),
    ("measures.json", "no object", lambda _: b"null"),
    ("measures.json", "deep", lambda _: b"[" * 100_000),
    ("measures.json", "no text", lambda _: b"\xff\xfe\x00"),
    ("measures.json", "of a later version", _with(format="footscan.measures/9")),
    ("measures.json", "huge transform", _with(transform=[[1e308] * 4] * 4)),
    ("measures.json", "small transform", _with(transform=[[1.0], [2.0], [3.0], [4.0]])),
    ("measures.json", "no numbers", _with(transform=[[float("nan")] * 4] * 4)),
    ("measures.json", "many measures", _with(measures=MANY)),
    ("measures.json", "long", lambda sound: b" " * 60_000_000 + sound),
    ("measures.json", "cut off", lambda sound: sound[:-40]),
    ("quality.json", "deep", lambda _: b'{"a":' * 50_000),
    ("quality.json", "long", lambda _: b" " * 60_000_000),
    ("quality.json", "cut off", lambda sound: sound[:-40]),
    ("foot.ply", "empty", lambda _: b""),
    ("foot.ply", "cut off", lambda sound: sound[:-1000]),
    ("foot.ply", "head alone", lambda sound: sound[:60]),
    ("foot.ply", "cloud", lambda _: (PLY.format(2, "") + "0 0 0\n1 1 1\n").encode()),
    ("foot.ply", "nothing in it", lambda _: PLY.format(0, FACES.format(0)).encode()),
    ("foot.ply", "claims much", lambda _: PLY.format(10**9, FACES.format(10**9)).encode()),
    ("foot.ply", "no places", lambda _: (PLY.format(3, FACES.format(1)) + "nan 0 0\n" * 3 + "3 0 1 2\n").encode()),
    ("foot.ply", "far away", lambda _: (PLY.format(3, FACES.format(1)) + "1e30 0 0\n" * 3 + "3 0 1 2\n").encode()),
    ("foot.ply", "other corners", lambda _: (PLY.format(3, FACES.format(1)) + "1 0 0\n" * 3 + "3 0 1 9\n").encode()),
    ("foot.ply", "large", lambda sound: sound + b"\0" * 150_000_000),
]


@pytest.mark.parametrize(("name", "kind", "change"), CONTENTS, ids=[f"{name} {kind}" for name, kind, _ in CONTENTS])
def test_other_contents_are_refused_in_a_line(
    web: TestClient, foot: Path, name: str, kind: str, change: Callable[[bytes], bytes]
) -> None:
    sound = (foot / name).read_bytes()
    for path in OF_A_PAGE[name]:
        assert web.get(path).status_code == 200
    (foot / name).write_bytes(change(sound))
    for path in OF_A_PAGE[name]:
        began = time.monotonic()
        answer = web.get(path)
        if answer.status_code == 200:  # of a pair the measures alone are looked at, not where they were taken
            assert (path, kind) in {("/pair/P1/L/R", "huge transform"), ("/pair/P1/L/R", "small transform")}
            continue
        assert answer.status_code == 404, kind
        assert answer.text.startswith("footscan: ")
        assert answer.text.count("\n") == 1
        assert len(answer.text) < 600
        assert time.monotonic() - began < GENEROUS_SECONDS
    (foot / name).write_bytes(sound)
    for path in OF_A_PAGE[name]:
        assert web.get(path).status_code == 200


@pytest.mark.parametrize("value", [1e308, -1e13])
def test_a_pair_of_impossible_measures_is_refused(web: TestClient, foot: Path, value: float) -> None:
    (foot / "measures.json").write_bytes(_value(value)((foot / "measures.json").read_bytes()))
    answer = web.get("/pair/P1/L/R")
    assert answer.status_code == 404
    assert answer.text.count("\n") == 1


def test_a_page_is_that_of_the_files_that_lie_there(web: TestClient, foot: Path) -> None:
    first = web.get("/foot/P1/R").text
    sound = (foot / "quality.json").read_bytes()
    (foot / "quality.json").write_bytes(sound.replace(b'"frames_lost": 0', b'"frames_lost": 150'))
    assert web.get("/foot/P1/R").text != first
    (foot / "quality.json").write_bytes(sound)
    assert web.get("/foot/P1/R").text == first


def test_a_download_that_becomes_shorter_is_cut_off(console: Console, foot: Path) -> None:
    """The server, over a real connection: an incomplete answer is recognisable, its error goes to no other client."""
    size = 64 * 2**20
    _sparse(size)(foot / "foot.stl")
    with listen("127.0.0.1", 0) as listening:
        server = server_of(console, "127.0.0.1", None)
        thread = threading.Thread(target=lambda: server.run(sockets=[listening]))
        thread.start()
        try:
            came, length = _half_a_download(listening.getsockname(), foot / "foot.stl")
        finally:
            console.closing.set()
            server.should_exit = True
            thread.join(60)
    assert length == size
    assert 0 < came < size


def _half_a_download(address: tuple[str, int], file: Path) -> tuple[int, int]:
    """Bytes received of a file that was emptied after its first part, and its content-length."""
    with socket.create_connection(address, 30) as connection:
        connection.sendall(b"GET /results/P1/R/foot.stl HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        begin = b""
        while not begin.partition(b"\r\n\r\n")[2]:
            begin += connection.recv(65536)
        head, _, body = begin.partition(b"\r\n\r\n")
        os.truncate(file, 0)
        came = len(body)
        while part := connection.recv(2**20):
            came += len(part)
    fields = dict(line.split(b": ", 1) for line in head.lower().split(b"\r\n")[1:])
    return came, int(fields[b"content-length"])
