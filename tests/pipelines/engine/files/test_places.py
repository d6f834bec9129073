"""The files of a store behave alike in a folder and at a URL."""

import os
import uuid
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import fsspec
import pytest

from pipelines.engine.actions.step import Output, Step, Success, Value
from pipelines.engine.files.names import blob_name
from pipelines.engine.files.places import Files, LocalFiles, RemoteFiles, open_files
from pipelines.engine.plan import State, make_plan
from pipelines.engine.pool import StepEnd, Threads
from pipelines.engine.run import run_plan
from pipelines.engine.store.store import open_store
from schemas.base.errors import Fault, RefusedInput

NAME = "blobs/ab/abcd"
OTHER = "blobs/cd/cdef"


@pytest.fixture(params=["folder", "file://", "local://", "memory://", "memory:// and a slash"])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Path | str]:
    """Places for a store, all empty."""
    kind: str = request.param
    if kind == "folder":
        yield tmp_path / "store"
    elif not kind.startswith("memory"):
        yield f"{kind}{tmp_path / 'store'}"
    else:
        root = f"memory://{uuid.uuid4().hex}"
        yield root + ("/" if kind.endswith("slash") else "")
        memory = fsspec.filesystem("memory")
        if memory.exists(root):
            memory.rm(root, recursive=True)


@pytest.fixture
def files(place: Path | str) -> Files:
    return open_files(place)


def test_which_files_a_place_has(tmp_path: Path) -> None:
    assert open_files(tmp_path) == open_files(str(tmp_path)) == open_files(f"file://{tmp_path}")
    assert open_files(tmp_path) == LocalFiles(str(tmp_path))
    assert open_files("memory://store") == RemoteFiles("memory://store")


@pytest.mark.parametrize("data", [b"", b"x", bytes(range(256)) * 5000])
def test_gives_back_what_was_written(files: Files, data: bytes) -> None:
    files.write(NAME, b"something else")
    files.write(NAME, data)
    assert files.read(NAME) == data
    assert isinstance(files.read(NAME), bytes)
    files.write(OTHER, b"other")
    assert files.read(NAME) == data
    assert files.path(NAME).endswith(f"/{NAME}")
    assert "//blobs" not in files.path(NAME)


def test_what_is_not_there(files: Files) -> None:
    for name in (NAME, "blobs"):
        assert files.state(name) is None
        with pytest.raises(FileNotFoundError):
            files.read(name)
    files.remove(NAME)
    assert list(files.sizes("blobs")) == []


def test_removed_is_gone(files: Files) -> None:
    files.write(NAME, b"x")
    files.write(OTHER, b"x")
    files.remove(NAME)
    files.remove(NAME)
    assert files.state(NAME) is None
    with pytest.raises(FileNotFoundError):
        files.read(NAME)
    assert files.read(OTHER) == b"x"


def test_state_changes_with_the_content_and_not_without(files: Files) -> None:
    states = []
    for data in (b"", b"a", b"ab", b"a"):
        files.write(NAME, data)
        states.append(files.state(NAME))
        assert files.state(NAME) == states[-1]
        files.read(NAME)
        files.write(OTHER, data)
        assert files.state(NAME) == states[-1]
    assert None not in states
    assert len(set(states[:3])) == 3


def test_state_tells_content_of_the_same_size(place: Path | str, files: Files) -> None:
    files.write(NAME, b"abc")
    before = files.state(NAME)
    wait_for_the_clock_of(files)
    if str(place).startswith("memory"):
        fsspec.filesystem("memory").pipe_file(files.path(NAME), b"xyz")
    else:
        local_path(files, NAME).write_bytes(b"xyz")  # in place
    assert files.state(NAME) != before


def test_time_set_back_hides_no_change_in_a_folder(tmp_path: Path) -> None:
    files = open_files(tmp_path)
    files.write(NAME, b"abc")
    before, times = files.state(NAME), (tmp_path / NAME).stat()
    wait_for_the_clock_of(files)
    (tmp_path / NAME).write_bytes(b"xyz")
    os.utime(tmp_path / NAME, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert files.state(NAME) != before


def test_sizes(files: Files) -> None:
    names = {"blobs/ab/abcd": 0, "blobs/ab/abce": 3, "blobs/b/x": 1_000_000, "actions/ab/x.json": 2}
    for name, size in reversed(names.items()):
        files.write(name, bytes(size))
    assert list(files.sizes("blobs")) == [(n, s) for n, s in names.items() if n.startswith("blobs")]
    assert list(files.sizes("actions")) == [("actions/ab/x.json", 2)]
    assert list(files.sizes("latest")) == []
    files.write("blobs/b/x", b"now small")
    files.remove("blobs/ab/abce")
    assert list(files.sizes("blobs")) == [("blobs/ab/abcd", 0), ("blobs/b/x", 9)]


@pytest.mark.parametrize(
    ("url", "problem"),
    [
        ("nowhere://x/y", "expected a place that fsspec reaches (Protocol not known: nowhere)"),
        ("s3 ://x", "expected a place that fsspec reaches (Protocol not known: s3)"),
        ("github://x", "expected a place that fsspec reaches (GithubFileSystem.__init__() missing"),
        ("memory://", "names no place, expected PROTOCOL://BUCKET/FOLDER or the like"),
        ("memory:///", "names no place, expected PROTOCOL://BUCKET/FOLDER or the like"),
        ("s3://", "names no place, expected PROTOCOL://BUCKET/FOLDER or the like"),
        ("://", "names no place, expected PROTOCOL://BUCKET/FOLDER or the like"),
        ("://x", "names no protocol, expected PROTOCOL://BUCKET/FOLDER or the like"),
        ("c://x", "names no protocol, expected PROTOCOL://BUCKET/FOLDER or the like"),
        ("file://", "expected file:// and a path from the root, as file:///srv/store"),
        ("local://store", "expected local:// and a path from the root, as local:///srv/store"),
    ],
)
def test_what_is_no_place_is_refused_in_one_line(url: str, problem: str) -> None:
    with pytest.raises(RefusedInput) as refused:
        open_store(url)
    assert str(refused.value).startswith(f"{url}: {problem}")
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.skipif(find_spec("s3fs") is not None, reason="s3fs is installed")
def test_missing_library_is_named() -> None:
    with pytest.raises(RefusedInput, match=r" \(Install s3fs to access S3: No module named .s3fs.\)$"):
        open_store("s3://feet/store")


def test_write_that_fails_is_a_fault(files: Files, place: Path | str, monkeypatch: pytest.MonkeyPatch) -> None:
    if str(place).startswith("memory"):

        def full(*_: Any, **__: Any) -> None:
            raise RuntimeError("quota\nexceeded")  # no OSError: each kind of store has its own

        monkeypatch.setattr(type(fsspec.filesystem("memory")), "pipe_file", full)
    else:
        blobs = local_path(files, "blobs")
        blobs.parent.mkdir()
        blobs.write_bytes(b"a file where a folder is expected")
    with pytest.raises(Fault, match=r"abcd: cannot be written \(.+\)$") as fault:
        files.write(NAME, b"x")
    assert len(str(fault.value).splitlines()) == 1
    assert files.state(NAME) is None


def test_write_that_fails_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = open_files(tmp_path)
    files.write(NAME, b"old")

    def full(path: Path, data: bytes) -> int:
        with path.open("wb") as file:
            file.write(data[:1])
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        with pytest.raises(Fault, match="No space left on device"):
            files.write(NAME, b"new")
    assert files.read(NAME) == b"old"
    assert list(files.sizes("blobs")) == [(NAME, 3)]


def test_plan_and_run_on_a_store_anywhere(place: Path | str, package: Any, tmp_path: Path) -> None:
    module = package.step_module("join")
    memory = tmp_path / "known.sqlite"

    def run(value: bytes) -> tuple[list[State], list[str], bytes | None]:
        """States of the planned steps, the steps that ran, and the result."""
        steps = [
            Step("P/S", "first", module, None, {"a": Value(value), "b": Value(b"b")}),
            Step("P/S", "second", module, None, {"x": Output("P/S/first"), "y": Value(b"y")}),
        ]
        store = open_store(place, memory)
        ends: list[StepEnd] = []
        plan = make_plan(steps, store)
        outcome = run_plan(plan, store, pool=Threads(2), on_step_end=ends.append)["P/S/second"]
        assert isinstance(outcome, Success)
        assert store.verified is not None
        store.verified.close()
        return [p.state for p in plan.steps], [end.step.kind for end in ends if end.ran], store.get(outcome.digest)

    nothing, everything = [State.MISS, State.WAITS], [State.HIT, State.HIT]
    assert run(b"a") == (nothing, ["first", "second"], b"a+b+y")
    assert run(b"a") == (everything, [], b"a+b+y")
    assert run(b"A") == (nothing, ["first", "second"], b"A+b+y")
    memory.unlink()
    assert run(b"a") == (everything, [], b"a+b+y")
    store = open_store(place)
    wait_for_the_clock_of(store.files)
    store.files.write(blob_name(store.put(b"a+b")), b"a*b")
    assert run(b"a") == ([State.MISS, State.WAITS], ["first"], b"a+b+y")
    assert run(b"a") == (everything, [], b"a+b+y")


def local_path(files: Files, name: str) -> Path:
    return Path(files.path(name).partition("://")[2] or files.path(name))


def wait_for_the_clock_of(files: Files) -> None:
    """Until a file that is written anew has another state: time stands still for some ms in file systems."""
    files.write("clock/a", b"x")
    before = files.state("clock/a")
    while files.state("clock/a") == before:
        if isinstance(files, LocalFiles):
            Path(files.path("clock/a")).write_bytes(b"x")
        else:
            files.write("clock/a", b"x")
