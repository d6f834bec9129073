"""A store at a URL: an error of its server becomes one line and is never taken for a missing blob."""

import logging
import pickle
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any, ClassVar

import fsspec
import pytest
from fsspec.spec import AbstractFileSystem

from pipelines.engine import audit
from pipelines.engine import garbage_collection as collect
from pipelines.engine.actions.key import image_text, key_of
from pipelines.engine.actions.step import Failure, Step, Success, Value
from pipelines.engine.files.names import blob_name, row_name
from pipelines.engine.files.places import open_files
from pipelines.engine.plan import make_plan
from pipelines.engine.pool import Threads
from pipelines.engine.run import run_plan
from pipelines.engine.store.lease import lease, live_leases
from pipelines.engine.store.store import Row, Store, open_store
from schemas.base.errors import Fault

PLACE = "made-up://bucket/feet"
NAME = "blobs/ab/abcd"
OTHER = "blobs/cd/cdef"
IMAGE = {"step": "clean", "code": "d" * 64, "parameters": None, "inputs": {}}


class ServerError(Exception):
    """An error class that only the library of the store knows, such as botocore's ClientError."""


class Server(AbstractFileSystem):  # type: ignore[misc]  # fsspec has no types
    """A failing store that caches its listings, as fsspec's object stores and FTP do."""

    protocol = "made-up"
    cachable = False
    root_marker = ""
    content: ClassVar[dict[str, bytes]] = {}
    error: ClassVar[Exception | None] = None
    """Error that it raises."""
    fails: ClassVar[Callable[[str, str], bool]]
    """True if an operation on a path raises the error."""

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
    """An empty server without errors."""
    fsspec.register_implementation("made-up", Server, clobber=True)
    yield Server
    Server.content.clear()
    Server.error = None


@pytest.mark.parametrize("fact", ["ETag", "etag", "md5Hash", "mtime", "created", "LastModified", "modify"])
def test_state_is_what_the_kind_of_store_tells(
    server: type[Server], monkeypatch: pytest.MonkeyPatch, fact: str
) -> None:
    files, states = open_files(PLACE), []
    for fact_value in ("a", "b", "b"):
        monkeypatch.setattr(server, "info", lambda *_, now=fact_value: {"size": 3, "atime": object(), fact: now})
        states.append(files.state(NAME))
    assert states[0] != states[1] == states[2]


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
        assert not isinstance(fault.value, OSError)  # an OSError would be a miss
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
    """Files that others write, replace or delete are seen at once, despite cached listings."""
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
def remote(server: type[Server], tmp_path: Path) -> Store:
    """A store on that server, with a result."""
    del server
    store = open_store(PLACE, tmp_path / "known.sqlite")
    store.record("P/S/clean", Row(IMAGE, store.put(b"result")))
    return store


@pytest.mark.parametrize("error", [error for error, _ in ERRORS])
@pytest.mark.parametrize("failing", ["all", "actions", "blobs"])
def test_server_that_is_away_is_no_miss(
    remote: Store, server: type[Server], error: Exception, failing: str, caplog: pytest.LogCaptureFixture
) -> None:
    step = Step("P/S", "clean", "pipelines.steps.measure", None, {"a": Value(b"a")})
    digest, key = remote.put(b"result"), key_of(IMAGE)
    server.error, server.fails = error, lambda _, path: failing == "all" or f"/{failing}/" in path
    blobs: list[Callable[[], object]] = [lambda: remote.get(digest), lambda: remote.put(b"result")]
    rows: list[Callable[[], object]] = [lambda: remote.row(key), lambda: make_plan([step], remote)]
    for ask in [
        lambda: remote.lookup(key),
        *(blobs if failing != "actions" else []),
        *(rows if failing != "blobs" else []),
    ]:
        with pytest.raises(Fault, match=f"^{PLACE}/.*: cannot be ") as fault:
            ask()
        assert len(str(fault.value).splitlines()) == 1
    assert caplog.messages == []
    server.error = None
    assert remote.get(digest) == b"result"
    assert remote.lookup(key) is not None


@pytest.mark.parametrize("error", [error for error, _ in ERRORS])
def test_server_that_is_away_costs_nothing_in_the_store(remote: Store, server: type[Server], error: Exception) -> None:
    """An unreadable file does not count as damaged, and an unreadable lease does not count as missing."""
    before = dict(server.content)
    server.error, server.fails = error, lambda what, _: what != "rm_file"
    asked: list[Callable[[], object]] = [
        lambda: audit.verify(remote), lambda: collect.read_contents(remote), lambda: live_leases(remote),
        lambda: collect.delete(collect.Garbage([*before]), remote), lambda: remote.files.written(NAME),
    ]  # fmt: skip
    for ask in asked:
        with pytest.raises(Fault, match=f"^{PLACE}/.*: cannot be "):
            ask()
    server.fails = lambda what, _: what == "cat_file"
    with pytest.raises(Fault, match="cannot be read"):
        audit.verify(remote)
    assert server.content == before


@pytest.mark.parametrize("kept", [0, 3])
def test_half_an_upload_is_a_miss_said_aloud(
    remote: Store, server: type[Server], kept: int, caplog: pytest.LogCaptureFixture
) -> None:
    digest, key = remote.put(b"result"), key_of(IMAGE)
    server.content[f"bucket/feet/{blob_name(digest)}"] = b"result"[:kept]
    with caplog.at_level(logging.WARNING):
        assert remote.lookup(key) is None
    assert caplog.messages == [f"{PLACE}/{blob_name(digest)}: damaged, will be made again"]
    assert remote.put(b"result") == digest
    assert remote.lookup(key) is not None
    row = f"bucket/feet/{row_name(key)}"
    server.content[row] = server.content[row][: -7 - kept]
    caplog.clear()
    assert remote.lookup(key) is None
    assert caplog.messages == [f"{PLACE}/{row_name(key)}: damaged, will be made again"]


def test_damage_in_a_store_that_one_may_only_read_is_a_miss(remote: Store, server: type[Server]) -> None:
    server.content[f"bucket/feet/{blob_name(remote.put(b'result'))}"] = b"half"
    server.error, server.fails = PermissionError("Forbidden"), lambda what, _: what in ("rm_file", "pipe_file")
    assert remote.lookup(key_of(IMAGE)) is None


def test_run_that_cannot_take_its_lease_away_has_ended_well(remote: Store, server: type[Server]) -> None:
    with lease(remote):
        assert len(live_leases(remote)) == 1
        server.error, server.fails = ServerError("gone"), lambda *_: True
    server.error = None
    assert len(live_leases(remote)) == 1


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


def test_no_connection_and_no_content_travels_to_a_worker(remote: Store) -> None:
    remote.put(bytes(100_000))
    travelling = pickle.dumps(remote)
    assert len(travelling) < 1000
    there: Store = pickle.loads(travelling)
    assert there.files == remote.files
    assert there.get(remote.put(b"result")) == b"result"
