"""Small files in packs read, list and go as if each lay by itself, for several processes at once."""

import pickle
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

import fsspec
import numpy as np
import pytest

from pipelines.engine.files import packs
from pipelines.engine.files.digest import sha256
from pipelines.engine.files.names import blob_name, latest_name, row_name
from pipelines.engine.files.packs import PackedFiles
from pipelines.engine.files.places import Files, open_files
from schemas.base.errors import Fault

ROWS = [row_name(sha256(f"row {number}".encode())) for number in range(40)]
LATEST = [latest_name(f"P/S/{number}") for number in range(8)]
BLOB = blob_name(sha256(b"blob"))


@pytest.fixture(params=["folder", "memory"])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Files]:
    if request.param == "folder":
        yield open_files(tmp_path / "store")
    else:
        root = f"memory://{uuid.uuid4().hex}"
        yield open_files(root)
        memory = fsspec.filesystem("memory")
        if memory.exists(root):
            memory.rm(root, recursive=True)


@pytest.fixture(autouse=True)
def small_packs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packs, "PACK_BYTES", 100)
    monkeypatch.setattr(packs, "MANY", 5)


def content(number: int) -> bytes:
    return f"{number}".encode() * (number % 7)


def filled(place: Files) -> dict[str, bytes]:
    files = {name: content(number) for number, name in enumerate([*ROWS, *LATEST, BLOB])}
    for name, data in files.items():
        place.write(name, data)
    return files


def check(files: PackedFiles, expected: dict[str, bytes]) -> None:
    assert dict(files.sizes("")) == {name: len(data) for name, data in expected.items()}
    for folder in ("actions", "latest", "blobs", ROWS[0][:10]):
        inside = {name: len(data) for name, data in expected.items() if name.startswith(f"{folder}/")}
        assert list(files.sizes(folder)) == sorted(inside.items())
    for name in [*ROWS, *LATEST, BLOB]:
        assert (files.state(name) is None) == (files.written(name) is None) == (name not in expected)
        if name in expected:
            assert files.read(name) == expected[name]
        else:
            with pytest.raises(FileNotFoundError):
                files.read(name)


def test_packed_files_are_as_before(place: Files) -> None:
    expected, files = filled(place), PackedFiles(place)
    files.pack(files.many_by_themselves())
    assert [name for name, _ in place.sizes("") if not name.startswith("packs/")] == [BLOB]
    assert len(list(place.sizes("packs"))) < 20
    assert abs((files.written(ROWS[0]) or 0.0) - time.time()) < 60.0
    for same in (files, PackedFiles(place), pickle.loads(pickle.dumps(files))):
        assert same == files
        check(same, expected)


def test_few_files_stay_by_themselves(place: Files) -> None:
    for name in [*ROWS[:4], BLOB]:
        place.write(name, b"x")
    assert PackedFiles(place).many_by_themselves() == []


@pytest.mark.parametrize("seed", range(6))
def test_two_processes_write_pack_and_remove(place: Files, seed: int) -> None:
    random = np.random.default_rng(seed)
    processes, expected, names = (PackedFiles(place), PackedFiles(place)), filled(place), [*ROWS, *LATEST, BLOB]
    for number in range(60):
        files = processes[random.integers(2)]
        some = [names[k] for k in random.permutation(len(names))[: random.integers(1, 9)]]
        match random.integers(4):
            case 0:
                files.pack(files.many_by_themselves())
            case 1:
                files.remove_all(some)
                expected = {name: data for name, data in expected.items() if name not in some}
            case 2:
                files.remove(some[0])
                expected.pop(some[0], None)
            case _:
                for name in some:
                    expected[name] = content(number)
                    files.write(name, expected[name])
        check(processes[random.integers(2)], expected)
    for files in processes:
        check(files, expected)


def test_nothing_that_was_removed_is_left_in_a_pack(place: Files) -> None:
    files = PackedFiles(place)
    for version in (b"first secret", b"second secret"):
        for name in ROWS[:6]:
            files.write(name, version)
        files.pack(files.many_by_themselves())
    files.remove_all(ROWS[:5])
    left = b"".join(place.read(name) for name, _ in place.sizes(""))
    assert (left.count(b"first secret"), left.count(b"second secret")) in ((1, 1), (0, 1))
    files.remove(ROWS[5])
    assert list(place.sizes("")) == []


@pytest.mark.parametrize("at", ["packs/actions", "actions", "latest"])
def test_an_interrupted_packing_loses_nothing(place: Files, at: str, monkeypatch: pytest.MonkeyPatch) -> None:
    expected, files = filled(place), PackedFiles(place)
    files.pack(ROWS[:6])
    remove = type(place).remove

    def remove_or_end(self: Files, name: str) -> None:
        if name.startswith(at):
            raise Fault("killed")
        remove(self, name)

    with monkeypatch.context() as killed:
        killed.setattr(type(place), "remove", remove_or_end)
        with pytest.raises(Fault, match="killed"):
            files.pack(files.many_by_themselves())
    check(PackedFiles(place), expected)
    files.pack(files.many_by_themselves())
    check(files, expected)


def test_a_file_that_is_written_while_it_is_packed_stays(place: Files, monkeypatch: pytest.MonkeyPatch) -> None:
    expected, files = filled(place), PackedFiles(place)
    with monkeypatch.context() as overtaken:
        read = type(place).read

        def read_and_write(self: Files, name: str) -> bytes:
            data = read(self, name)
            if name == ROWS[0]:
                self.write(name, b"newer, and longer")
            return data

        overtaken.setattr(type(place), "read", read_and_write)
        files.pack(ROWS)
    check(PackedFiles(place), expected | {ROWS[0]: b"newer, and longer"})


def test_a_damaged_pack_counts_as_missing(place: Files, caplog: pytest.LogCaptureFixture) -> None:
    filled(place)
    PackedFiles(place).pack(ROWS)
    *sound, last = [name for name, _ in place.sizes("packs")]
    place.write(last, b"x" + place.read(last)[1:])
    files = PackedFiles(place)
    assert files.damaged_packs() == [last]
    assert caplog.messages == [f"{place.path(last)}: damaged, what it holds will be made again"]
    assert len(sound) > 1
    assert 0 < sum(files.state(name) is None for name in ROWS) < len(ROWS)
    files.remove_all(files.damaged_packs())
    assert files.damaged_packs() == []
