"""The index of verified rows saves reading; if it is lost or damaged, all is slower and still right."""

import os
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from random import Random
from typing import Any

import pytest

from pipelines.engine.actions.key import key_of
from pipelines.engine.files.names import blob_name, row_name
from pipelines.engine.store import verified_index as memory_module
from pipelines.engine.store.store import Row, Store, open_store
from pipelines.engine.store.verified_index import VerifiedIndex, VerifiedRow

FLIPS = 150 if (asked := os.environ.get("FOOTSCAN_FUZZ")) is None else 20 * int(asked)
IMAGES = [{"step": "clean", "code": "d" * 64, "parameters": None, "inputs": {"n": ["value", c * 64]}} for c in "abcdef"]
KEYS = [key_of(image) for image in IMAGES]

Truth = dict[str, tuple[str | None, str | None, str | None]]
"""Digest, kind and problem of each action."""

OTHER_SCHEMAS = [
    "CREATE TABLE known (key TEXT PRIMARY KEY)",
    "CREATE TABLE known (key TEXT, row TEXT, digest TEXT, kind TEXT, problem TEXT, blob TEXT)",
    "CREATE TABLE known (a, b, c, d, e, f)",
    "CREATE TABLE known (key TEXT PRIMARY KEY, row TEXT, digest TEXT, problem TEXT, kind TEXT, blob TEXT)",
    "CREATE TABLE known (key TEXT PRIMARY KEY, row TEXT, digest TEXT, kind TEXT, problem TEXT, blob TEXT, more TEXT)",
    "CREATE TABLE other (x)",
    "CREATE VIEW known AS SELECT 1 AS key, 2 AS row, 3 AS digest, 4 AS kind, 5 AS problem, 6 AS blob",
]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "known.sqlite"


@pytest.fixture
def truth(tmp_path: Path, file: Path) -> Truth:
    """Actions in a store, all of them in the index."""
    store = open_store(tmp_path / "store", file)
    for number, image in enumerate(IMAGES):
        failed = ("refused", "finding")[number % 2], f"camera {number}"
        row = Row(image, None, failed) if number < 2 else Row(image, store.put(b"%d" % number))
        store.record(f"P/S/{number}", row)
    close(store)
    return {key: answer for key, answer in lookups(open_store(tmp_path / "store")).items() if answer}


def lookups(store: Store) -> dict[str, tuple[str | None, str | None, str | None] | None]:
    """Outcome of each action according to the store."""
    rows = {key: store.lookup(key) for key in KEYS}
    return {key: row and (row.digest, row.kind, row.problem) for key, row in rows.items()}


def close(store: Store) -> None:
    assert store.verified is not None
    store.verified.close()


def reads_of(store: Store, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the store's files that are read from now on."""
    reads: list[str] = []
    original = type(store.files).read

    def read(self: Any, name: str) -> bytes:
        reads.append(name)
        return original(self, name)

    monkeypatch.setattr(type(store.files), "read", read)
    return reads


def check_only_slower(file: Path, truth: Truth, monkeypatch: pytest.MonkeyPatch, *, heals: bool = True) -> None:
    """The store gives the true outcomes twice; the second time it reads nothing again."""
    for last in (False, True):
        store = open_store(file.parent / "store", file)
        with monkeypatch.context() as patch:
            reads = reads_of(store, patch)
            assert lookups(store) == truth
        assert not (last and heals and reads)
        close(store)


def test_remembered_is_not_read(file: Path, truth: Truth, monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(truth) == len(KEYS)
    store = open_store(file.parent / "store", file)
    reads = reads_of(store, monkeypatch)
    assert lookups(store) == truth
    assert reads == []
    close(store)


@pytest.mark.parametrize("touched", ["row", "blob"])
def test_what_was_touched_is_read(file: Path, truth: Truth, monkeypatch: pytest.MonkeyPatch, touched: str) -> None:
    digest = truth[KEYS[3]][0]
    assert digest is not None
    row, blob = row_name(KEYS[3]), blob_name(digest)
    time.sleep(0.01)  # time stands still for some ms in file systems
    (file.parent / "store" / (row if touched == "row" else blob)).touch()
    store = open_store(file.parent / "store", file)
    reads = reads_of(store, monkeypatch)
    assert lookups(store) == truth
    assert reads == ([row, blob] if touched == "row" else [blob])
    close(store)


def test_lost(file: Path, truth: Truth, monkeypatch: pytest.MonkeyPatch) -> None:
    file.unlink()
    check_only_slower(file, truth, monkeypatch)


def test_lost_while_it_is_used(file: Path, truth: Truth, monkeypatch: pytest.MonkeyPatch) -> None:
    store = open_store(file.parent / "store", file)
    assert lookups(store) == truth
    file.unlink()
    assert lookups(store) == truth
    close(store)
    check_only_slower(file, truth, monkeypatch)


@pytest.mark.parametrize("garbage", [b"", b"x", b"SQLite format 3\0", bytes(5000), bytes(range(256)) * 50])
def test_garbage(file: Path, truth: Truth, monkeypatch: pytest.MonkeyPatch, garbage: bytes) -> None:
    file.write_bytes(garbage)
    check_only_slower(file, truth, monkeypatch)


@pytest.mark.parametrize("tenths", range(10))
def test_truncated(file: Path, truth: Truth, monkeypatch: pytest.MonkeyPatch, tenths: int) -> None:
    content = file.read_bytes()
    file.write_bytes(content[: len(content) * tenths // 10])
    check_only_slower(file, truth, monkeypatch)


@pytest.mark.parametrize("schema", OTHER_SCHEMAS)
def test_another_schema(file: Path, truth: Truth, monkeypatch: pytest.MonkeyPatch, schema: str) -> None:
    file.unlink()
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.execute(schema)
    check_only_slower(file, truth, monkeypatch)


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE known SET digest = 'g' || substr(digest, 2)",
        "UPDATE known SET digest = '../../../../' || digest",
        "UPDATE known SET digest = 7",
        "UPDATE known SET digest = x'00ff'",
        "UPDATE known SET digest = NULL",
        "UPDATE known SET kind = NULL, problem = NULL",
        "UPDATE known SET problem = 'camera 9'",
        "UPDATE known SET kind = 'fault', problem = 7",
        "UPDATE known SET kind = CAST(x'ff' AS TEXT), row = CAST(x'fe' AS TEXT)",
        "UPDATE known SET digest = (SELECT min(digest) FROM known), blob = (SELECT min(blob) FROM known)",
    ],
)
def test_false_memories(file: Path, truth: Truth, monkeypatch: pytest.MonkeyPatch, change: str) -> None:
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.execute(change)
    check_only_slower(file, truth, monkeypatch)


def test_flipped_bits(file: Path, truth: Truth) -> None:
    content = file.read_bytes()
    random = Random("flipped bits")
    for _ in range(FLIPS):
        damaged = bytearray(content)
        places = [random.randrange(len(content)) for _ in range(random.choice((1, 1, 1, 10)))]
        for at in places:
            damaged[at] ^= 1 << random.randrange(8)
        file.write_bytes(damaged)
        store = open_store(file.parent / "store", file)
        assert lookups(store) == truth, places
        close(store)


def test_a_folder_in_its_place(file: Path, truth: Truth, monkeypatch: pytest.MonkeyPatch) -> None:
    file.unlink()
    file.mkdir()
    check_only_slower(file, truth, monkeypatch, heals=False)


def test_a_file_where_its_folder_should_be(file: Path, truth: Truth) -> None:
    store = open_store(file.parent / "store", file / "below" / "known.sqlite")
    assert lookups(store) == truth
    close(store)


def test_read_only(file: Path, truth: Truth, monkeypatch: pytest.MonkeyPatch) -> None:
    original = sqlite3.connect

    def connect(path: Path, **options: Any) -> sqlite3.Connection:
        return original(f"{path.as_uri()}?mode=ro", uri=True, **options)

    before = file.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(memory_module.sqlite3, "connect", connect)
        store = open_store(file.parent / "store", file)
        store.record("P/S/9", Row(IMAGES[0] | {"step": "more"}, None, ("finding", "x")))
        assert lookups(store) == truth
        close(store)
        assert lookups(store) == truth
        close(store)
    assert file.read_bytes() == before
    check_only_slower(file, truth, monkeypatch)


def test_busy_with_another_run(file: Path, truth: Truth, monkeypatch: pytest.MonkeyPatch) -> None:
    original = sqlite3.connect
    waits: list[Path] = []

    def connect(path: Path, **options: Any) -> sqlite3.Connection:
        waits.append(path)
        return original(path, **options | {"timeout": 0})

    monkeypatch.setattr(memory_module.sqlite3, "connect", connect)
    with closing(original(file)) as other:
        other.execute("BEGIN EXCLUSIVE")
        store = open_store(file.parent / "store", file)
        assert lookups(store) == truth
        assert len(waits) == 1
        close(store)
        other.execute("UPDATE known SET blob = 'of the other run'")
        other.commit()
    check_only_slower(file, truth, monkeypatch)


def test_threads_use_it_at_once(file: Path) -> None:
    memory = VerifiedIndex(file)
    wrong: list[VerifiedRow] = []

    def use(thread: int) -> None:
        for number in range(50):
            key, known = f"{thread} {number}", VerifiedRow("row", f"{thread} {number}", None, None, "blob")
            memory.put(key, known)
            if number % 10 == 0:
                memory.save()
            found = memory.get(key)
            if found != known:
                wrong.append(known)

    threads = [threading.Thread(target=use, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    memory.close()
    assert wrong == []
    again = VerifiedIndex(file)
    assert again.get("3 49") == VerifiedRow("row", "3 49", None, None, "blob")
    assert again.get("4 0") is None
    again.close()


USE = """
import sys
from pathlib import Path
from pipelines.engine.store.verified_index import VerifiedRow, VerifiedIndex

memory, name = VerifiedIndex(Path(sys.argv[1])), sys.argv[2]
for number in range(60):
    for key in ("both", f"{name} {number}"):
        memory.put(key, VerifiedRow("row", key, None, None, "blob"))
    memory.save()
    for key in ("both", f"{name} {number}"):
        assert memory.get(key) == VerifiedRow("row", key, None, None, "blob")
memory.close()
"""


def test_processes_use_it_at_once(file: Path) -> None:
    users = [subprocess.Popen([sys.executable, "-W", "error", "-c", USE, file, name]) for name in ("one", "two")]
    assert [user.wait() for user in users] == [0, 0]
    memory = VerifiedIndex(file)
    for key in ("both", *(f"{name} {number}" for name in ("one", "two") for number in range(60))):
        assert memory.get(key) == VerifiedRow("row", key, None, None, "blob")
    memory.close()


@pytest.fixture(autouse=True)
def no_connection_left_open(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Python reports unclosed connections since 3.13."""
    opened: list[sqlite3.Connection] = []
    original = sqlite3.connect

    def connect(*args: Any, **options: Any) -> sqlite3.Connection:
        opened.append(original(*args, **options))
        return opened[-1]

    monkeypatch.setattr(memory_module.sqlite3, "connect", connect)
    yield
    for connection in opened:
        with pytest.raises(sqlite3.ProgrammingError, match="closed"):
            connection.execute("SELECT 1")
