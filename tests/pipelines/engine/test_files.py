"""A store's files are the same to it wherever they lie."""

import logging
import os
import pickle
import uuid
from collections.abc import Callable, Iterator
from datetime import datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

import fsspec
import pytest
from fsspec.spec import AbstractFileSystem

from pipelines.engine import audit, collect
from pipelines.engine.files import Files, LocalFiles, RemoteFiles, open_files
from pipelines.engine.key import image_text, key_of
from pipelines.engine.lease import lease, live_leases
from pipelines.engine.plan import State, make_plan
from pipelines.engine.pool import StepEnd, Threads
from pipelines.engine.run import run_plan
from pipelines.engine.step import Failure, Output, Step, Success, Value
from pipelines.engine.store import Row, Store, blob_name, open_store, row_name
from schemas.errors import Fault, RefusedInput

NAME = "blobs/ab/abcd"
OTHER = "blobs/cd/cdef"
IMAGE = {"step": "clean", "code": "d" * 64, "parameters": None, "inputs": {}}


class ServerError(Exception):
    """Of a kind that only its own library knows, as botocore's ClientError is."""


class Server(AbstractFileSystem):  # type: ignore[misc]  # fsspec has no types
    """A store that answers by listings which it remembers, as fsspec's object stores and FTP do, and that fails."""

    protocol = "made-up"
    cachable = False
    root_marker = ""
    content: ClassVar[dict[str, bytes]] = {}
    error: ClassVar[Exception | None] = None
    """What it raises instead of an answer."""
    fails: ClassVar[Callable[[str, str], bool]]
    """Whether it does so when it is asked to do something to a path."""

    def _ask(self, what: str, path: str) -> str:
        if Server.error is not None and Server.fails(what, path):
            raise Server.error
        return str(self._strip_protocol(path))

    def ls(self, path: str, detail: bool = True, **_: Any) -> list[Any]:
        path = self._ask("ls", path)
        if path not in self.dircache:
            below = [name.removeprefix(f"{path}/") for name in Server.content if name.startswith(f"{path}/")]
            files = {f"{path}/{name}": len(Server.content[f"{path}/{name}"]) for name in below if "/" not in name}
            folders = {f"{path}/{name.partition('/')[0]}" for name in below if "/" in name}
            self.dircache[path] = [
                *({"name": name, "size": size, "type": "file"} for name, size in files.items()),
                *({"name": name, "size": 0, "type": "directory"} for name in folders),
            ]
        if not self.dircache[path]:
            raise FileNotFoundError(path)
        return self.dircache[path] if detail else [entry["name"] for entry in self.dircache[path]]

    def info(self, path: str, **_: Any) -> dict[str, Any]:
        path = self._ask("info", path)
        for entry in self.ls(self._parent(path)):
            if entry["name"] == path:
                return dict(entry)
        raise FileNotFoundError(path)

    def cat_file(self, path: str, *_: Any, **__: Any) -> bytes:
        path = self._ask("cat_file", path)
        if path not in Server.content:
            raise FileNotFoundError(path)
        return Server.content[path]

    def modified(self, path: str) -> datetime:
        self._ask("modified", path)
        raise NotImplementedError

    def pipe_file(self, path: str, value: bytes, *_: Any, **__: Any) -> None:
        Server.content[self._ask("pipe_file", path)] = value

    def rm_file(self, path: str) -> None:
        if Server.content.pop(self._ask("rm_file", path), None) is None:
            raise FileNotFoundError(path)

    def invalidate_cache(self, path: str | None = None) -> None:
        del path
        self.dircache.clear()


@pytest.fixture
def server() -> Iterator[type[Server]]:
    """Empty, and well."""
    fsspec.register_implementation("made-up", Server, clobber=True)
    yield Server
    Server.content.clear()
    Server.error = None


PLACE = "made-up://bucket/feet"


@pytest.fixture(params=["folder", "file://", "local://", "memory://", "memory:// and a slash"])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Path | str]:
    """Where a store may lie; nothing is there yet."""
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


@pytest.mark.parametrize("fact", ["ETag", "etag", "md5Hash", "mtime", "created", "LastModified", "modify"])
def test_state_is_what_the_kind_of_store_tells(
    server: type[Server], monkeypatch: pytest.MonkeyPatch, fact: str
) -> None:
    files, states = open_files(PLACE), []
    for told in ("a", "b", "b"):
        monkeypatch.setattr(server, "info", lambda *_, now=told: {"size": 3, "atime": object(), fact: now})
        states.append(files.state(NAME))
    assert states[0] != states[1] == states[2]


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


def test_place_where_nothing_answers_is_a_fault() -> None:
    class Refusing(Server):
        def __init__(self, **_: Any) -> None:
            raise ConnectionRefusedError(111, "Connection refused")

    fsspec.register_implementation("refusing", Refusing, clobber=True)
    with pytest.raises(Fault, match=r"^refusing://x: cannot be opened \(ConnectionRefusedError: .* refused\)$"):
        open_store("refusing://x")


ERRORS: list[tuple[Exception, str]] = [
    (
        ServerError("An error occurred (503)\n<html>\tSlow Down"),
        "ServerError: An error occurred (503) <html> Slow Down",
    ),
    (PermissionError("Forbidden"), "PermissionError: Forbidden"),
    (ConnectionRefusedError(111, "Connection refused"), "ConnectionRefusedError: [Errno 111] Connection refused"),
    (TimeoutError(), "TimeoutError"),
    (OSError(5, "Input/output error"), "OSError: [Errno 5] Input/output error"),
]


@pytest.mark.parametrize(("error", "words"), ERRORS)
def test_whatever_a_store_raises_is_one_fault(server: type[Server], error: Exception, words: str) -> None:
    files = open_files(PLACE)
    files.write(NAME, b"x")
    server.error, server.fails = error, lambda *_: True
    asked: dict[str, Callable[[], object]] = {
        f"{PLACE}/{NAME}: cannot be read": lambda: files.read(NAME),
        f"{PLACE}/{NAME}: cannot be written": lambda: files.write(NAME, b"y"),
        f"{PLACE}/{NAME}: cannot be removed": lambda: files.remove(NAME),
        f"{PLACE}/{NAME}: cannot be looked up": lambda: files.state(NAME),
        f"{PLACE}/blobs: cannot be listed": lambda: list(files.sizes("blobs")),
    }
    for problem, ask in asked.items():
        with pytest.raises(Fault) as fault:
            ask()
        assert str(fault.value) == f"{problem} ({words})"
        assert fault.value.exit_status == 3
        assert not isinstance(fault.value, OSError)  # which is a miss
    server.error = None
    assert files.read(NAME) == b"x"


@pytest.mark.parametrize("error", [FileNotFoundError("x"), NotADirectoryError("x"), IsADirectoryError("x")])
def test_what_says_that_nothing_is_there_is_no_fault(server: type[Server], error: Exception) -> None:
    files = open_files(PLACE)
    server.error, server.fails = error, lambda *_: True
    assert files.state(NAME) is None
    assert list(files.sizes("blobs")) == []
    files.remove(NAME)
    with pytest.raises(FileNotFoundError):
        files.read(NAME)
    with pytest.raises(Fault, match=r"cannot be written \(\w+Error: x\)$"):
        files.write(NAME, b"x")


def test_folder_that_cannot_be_listed_is_not_left_out(server: type[Server]) -> None:
    files = open_files(PLACE)
    files.write(NAME, b"x")
    files.write(OTHER, b"x")
    server.error, server.fails = PermissionError("Forbidden"), lambda what, path: what == "ls" and path.endswith("cd")
    with pytest.raises(Fault, match=r"feet/blobs: cannot be listed \(PermissionError: Forbidden\)$"):
        list(files.sizes("blobs"))
    server.error = FileNotFoundError("the last file of the folder has just been deleted")
    assert list(files.sizes("blobs")) == [(NAME, 1)]


def test_listings_are_not_believed_for_long(server: type[Server]) -> None:
    """What others write, exchange or delete is seen at once, whatever was listed before."""
    files, inside = open_files(PLACE), "bucket/feet"
    files.write(NAME, b"x")
    assert list(files.sizes("blobs")) == [(NAME, 1)]
    server.content[f"{inside}/blobs/ab/abce"] = b"other's"
    assert files.state("blobs/ab/abce") is not None
    assert list(files.sizes("blobs")) == [(NAME, 1), ("blobs/ab/abce", 7)]
    before = files.state(NAME)
    server.content[f"{inside}/{NAME}"] = b"exchanged"
    assert files.state(NAME) != before
    del server.content[f"{inside}/{NAME}"]
    assert files.state(NAME) is None
    assert list(files.sizes("blobs")) == [("blobs/ab/abce", 7)]
    files.remove("blobs/ab/abce")
    assert list(files.sizes("")) == []


@pytest.fixture
def known(server: type[Server], tmp_path: Path) -> Store:
    """A store on that server, with a result."""
    del server
    store = open_store(PLACE, tmp_path / "known.sqlite")
    store.record("P/S/clean", Row(IMAGE, store.put(b"result")))
    return store


@pytest.mark.parametrize("error", [error for error, _ in ERRORS])
@pytest.mark.parametrize("failing", ["all", "actions", "blobs"])
def test_server_that_is_away_is_no_miss(
    known: Store, server: type[Server], error: Exception, failing: str, caplog: pytest.LogCaptureFixture
) -> None:
    step = Step("P/S", "clean", "pipelines.steps.measure", None, {"a": Value(b"a")})
    digest, key = known.put(b"result"), key_of(IMAGE)
    server.error, server.fails = error, lambda _, path: failing == "all" or f"/{failing}/" in path
    blobs: list[Callable[[], object]] = [lambda: known.get(digest), lambda: known.put(b"result")]
    rows: list[Callable[[], object]] = [lambda: known.row(key), lambda: make_plan([step], known)]
    for ask in [
        lambda: known.lookup(key),
        *(blobs if failing != "actions" else []),
        *(rows if failing != "blobs" else []),
    ]:
        with pytest.raises(Fault, match=f"^{PLACE}/.*: cannot be ") as fault:
            ask()
        assert len(str(fault.value).splitlines()) == 1
    assert caplog.messages == []
    server.error = None
    assert known.get(digest) == b"result"
    assert known.lookup(key) is not None


@pytest.mark.parametrize("error", [error for error, _ in ERRORS])
def test_server_that_is_away_costs_nothing_in_the_store(known: Store, server: type[Server], error: Exception) -> None:
    """Neither is what cannot be read taken for damaged, nor a run under way for none."""
    before = dict(server.content)
    server.error, server.fails = error, lambda what, _: what != "rm_file"
    asked: list[Callable[[], object]] = [
        lambda: audit.verify(known), lambda: collect.read_contents(known), lambda: live_leases(known),
        lambda: collect.delete(collect.Garbage([*before]), known), lambda: known.files.written(NAME),
    ]  # fmt: skip
    for ask in asked:
        with pytest.raises(Fault, match=f"^{PLACE}/.*: cannot be "):
            ask()
    server.fails = lambda what, _: what == "cat_file"
    with pytest.raises(Fault, match="cannot be read"):
        audit.verify(known)
    assert server.content == before


@pytest.mark.parametrize("kept", [0, 3])
def test_half_an_upload_is_a_miss_said_aloud(
    known: Store, server: type[Server], kept: int, caplog: pytest.LogCaptureFixture
) -> None:
    digest, key = known.put(b"result"), key_of(IMAGE)
    server.content[f"bucket/feet/{blob_name(digest)}"] = b"result"[:kept]
    with caplog.at_level(logging.WARNING):
        assert known.lookup(key) is None
    assert caplog.messages == [f"{PLACE}/{blob_name(digest)}: damaged, will be made again"]
    assert known.put(b"result") == digest
    assert known.lookup(key) is not None
    row = f"bucket/feet/{row_name(key)}"
    server.content[row] = server.content[row][: -7 - kept]
    caplog.clear()
    assert known.lookup(key) is None
    assert caplog.messages == [f"{PLACE}/{row_name(key)}: damaged, will be made again"]


def test_damage_in_a_store_that_one_may_only_read_is_a_miss(known: Store, server: type[Server]) -> None:
    server.content[f"bucket/feet/{blob_name(known.put(b'result'))}"] = b"half"
    server.error, server.fails = PermissionError("Forbidden"), lambda what, _: what in ("rm_file", "pipe_file")
    assert known.lookup(key_of(IMAGE)) is None


def test_run_that_cannot_take_its_lease_away_has_ended_well(known: Store, server: type[Server]) -> None:
    with lease(known):
        assert len(live_leases(known)) == 1
        server.error, server.fails = ServerError("gone"), lambda *_: True
    server.error = None
    assert len(live_leases(known)) == 1


def test_step_of_which_nothing_can_be_known_costs_its_scan_alone(server: type[Server], package: Any) -> None:
    module = package.step_module("join")
    steps = [Step(f"P/{scan}", "first", module, None, {"a": Value(scan.encode())}) for scan in ("S1", "S2")]
    store = open_store(PLACE)
    plan = make_plan(steps, store)
    row = key_of(image_text(steps[0], {"a": steps[0].inputs["a"].digest}))
    server.error, server.fails = ServerError("gone"), lambda _, path: path.endswith(row_name(row))
    first, second = run_plan(plan, store, pool=Threads(2), on_step_end=lambda _: None).values()
    assert first == Failure(f"{PLACE}/{row_name(row)}: cannot be looked up (ServerError: gone)", "fault", "P/S1/first")
    assert isinstance(second, Success)


def test_no_connection_and_no_content_travels_to_a_worker(known: Store) -> None:
    known.put(bytes(100_000))
    travelling = pickle.dumps(known)
    assert len(travelling) < 1000
    there: Store = pickle.loads(travelling)
    assert there.files == known.files
    assert there.get(known.put(b"result")) == b"result"


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
        """What was known, what ran, and the result."""
        steps = [
            Step("P/S", "first", module, None, {"a": Value(value), "b": Value(b"b")}),
            Step("P/S", "second", module, None, {"x": Output("P/S/first"), "y": Value(b"y")}),
        ]
        store = open_store(place, memory)
        ends: list[StepEnd] = []
        plan = make_plan(steps, store)
        outcome = run_plan(plan, store, pool=Threads(2), on_step_end=ends.append)["P/S/second"]
        assert isinstance(outcome, Success)
        assert store.memory is not None
        store.memory.close()
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
