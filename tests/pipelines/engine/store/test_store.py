"""The store checks everything that it reads."""

import json
import logging
import threading
from pathlib import Path
from typing import Any

import pytest

from pipelines.engine.actions.key import key_of
from pipelines.engine.files import places as files_module
from pipelines.engine.files.digest import sha256
from pipelines.engine.files.names import blob_name, row_name
from pipelines.engine.store.store import Latest, Row, Store
from pipelines.engine.store.verified_index import VerifiedRow
from schemas.base.errors import Fault
from schemas.base.model import canonical_json

IMAGE = {"step": "clean", "code": "d" * 64, "parameters": None, "inputs": {"cloud": ["result", "a" * 64]}}


def blob(store: Store, digest: str) -> Path:
    return Path(store.files.path(blob_name(digest)))


def action(store: Store) -> Path:
    return Path(store.files.path(row_name(key_of(IMAGE))))


def root(store: Store) -> Path:
    return Path(store.files.path(""))


def sealed(value: dict[str, Any]) -> bytes:
    return canonical_json({**value, "seal": sha256(canonical_json(value).encode())}).encode()


def result(store: Store, key: str = key_of(IMAGE)) -> str | None:
    """Recorded result of an action, by its digest."""
    known = store.lookup(key)
    return None if known is None else known.digest


@pytest.fixture
def digest(store: Store) -> str:
    """A result with its row."""
    digest = store.put(b"result")
    store.record("P/S/clean", Row(IMAGE, digest))
    return digest


def test_gives_back_what_was_put(store: Store) -> None:
    for data in (b"", b"abc", bytes(1_000_000)):
        digest = store.put(data)
        assert digest == sha256(data)
        assert store.get(digest) == data
        assert store.has(digest)
    assert store.get("0" * 64) is None
    assert not store.has("0" * 64)


@pytest.mark.parametrize("damage", [b"", b"resulT", b"result and more"])
def test_damaged_blob_is_a_miss_said_aloud_and_mended(
    store: Store, digest: str, damage: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    blob(store, digest).write_bytes(damage)
    with caplog.at_level(logging.WARNING):
        assert store.get(digest) is None
    assert caplog.messages == [f"{blob(store, digest)}: damaged, will be made again"]
    assert store.lookup(key_of(IMAGE)) is None
    assert store.put(b"result") == digest
    assert store.get(digest) == b"result"
    assert result(store) == digest


def test_put_mends_what_was_damaged_unseen(store: Store, digest: str) -> None:
    blob(store, digest).write_bytes(b"resulT")
    assert store.put(b"result") == digest
    assert store.get(digest) == b"result"


def test_rows_come_back(store: Store, digest: str) -> None:
    assert result(store) == digest
    assert store.latest("P/S/clean") == Latest("P/S/clean", key_of(IMAGE), {})
    assert store.row(key_of(IMAGE)) == Row(IMAGE, digest)
    assert store.latest("P/S/other") is None
    assert store.lookup("0" * 64) is None
    failure = Row(IMAGE | {"step": "x"}, None, ("finding", "no stripe in camera 3"))
    store.record("P/S/clean", failure)
    known = store.lookup(key_of(failure.image))
    assert isinstance(known, VerifiedRow)
    assert (known.digest, known.kind, known.problem) == (None, "finding", "no stripe in camera 3")
    assert store.latest("P/S/clean") == Latest("P/S/clean", key_of(failure.image), {})
    assert store.row(key_of(failure.image)) == failure
    assert result(store) == digest


def test_row_without_its_result_is_a_miss_but_still_tells_what_was(store: Store, digest: str) -> None:
    blob(store, digest).unlink()
    assert store.lookup(key_of(IMAGE)) is None
    assert store.latest("P/S/clean") == Latest("P/S/clean", key_of(IMAGE), {})
    assert store.row(key_of(IMAGE)) == Row(IMAGE, digest)


@pytest.mark.parametrize("hostile", ["../../../x", "/etc/passwd", "", "A" * 64, "a" * 63 + "\n", "a" * 65, "ä" * 64])
def test_hostile_digests_become_no_paths(
    store: Store, digest: str, hostile: str, caplog: pytest.LogCaptureFixture
) -> None:
    outside = root(store).parent / "x"
    outside.write_bytes(b"precious")
    action(store).write_bytes(sealed({"image": IMAGE, "digest": hostile, "failure": None}))
    assert store.lookup(key_of(IMAGE)) is None
    assert "damaged" in caplog.text
    for ask in (store.get, store.has, store.lookup):
        with pytest.raises(ValueError, match="is no SHA-256 digest"):
            ask(hostile)
    assert outside.read_bytes() == b"precious"
    assert blob(store, digest).exists()


def rows(image: Any = IMAGE, digest: Any = "a" * 64, failure: Any = None) -> bytes:
    try:
        return sealed({"image": image, "digest": digest, "failure": failure})
    except (ValueError, UnicodeEncodeError):  # what no store would write
        return json.dumps({"image": image, "digest": digest, "failure": failure, "seal": "0" * 64}).encode()


@pytest.mark.parametrize(
    "row",
    [
        b"", b"{}", b"null", b"[]", b"\xff", b"[" * 100_000, b'"text"', rows()[:-1],
        rows(digest=None), rows(digest=7), rows(digest=["a" * 64]),
        rows(digest=None, failure="xy"), rows(digest=None, failure=["finding"]),
        rows(digest=None, failure=["fault", "x"]),
        rows(digest=None, failure={"a": 1}), rows(digest=None, failure=["finding", 1]), rows(failure=["finding", "x"]),
        rows(image=None), rows(image=[1]), rows(image=IMAGE | {"step": "other"}), rows(image={"x": float("nan")}),
        rows(image={"x": "\ud800"}),
        b'{"image": ' + b'{"a":' * 5000 + b"1" + b"}" * 5000 + b', "digest": null, "failure": null}',
    ],
)  # fmt: skip
def test_damaged_rows_are_misses_said_aloud(
    store: Store, digest: str, row: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    action(store).write_bytes(row)
    assert store.lookup(key_of(IMAGE)) is None
    assert store.row(key_of(IMAGE)) is None
    assert caplog.messages == [f"{action(store)}: damaged, will be made again"] * 2
    store.record("P/S/clean", Row(IMAGE, digest))
    assert result(store) == digest


@pytest.mark.parametrize("pointer", [b"", b"../../x", b"\xff", b"0" * 64])
def test_damaged_memory_of_the_last_action_is_forgotten(store: Store, digest: str, pointer: bytes) -> None:
    [latest] = [path for path in (root(store) / "latest").rglob("*") if path.is_file()]
    latest.write_bytes(pointer)
    assert store.latest("P/S/clean") is None
    assert result(store) == digest


def test_disk_that_refuses_is_a_fault(store: Store) -> None:
    root(store).write_text("in the way")
    with pytest.raises(Fault, match="cannot be written"):
        store.put(b"result")
    with pytest.raises(Fault, match="cannot be written"):
        store.record("P/S/clean", Row(IMAGE, None, ("finding", "x")))
    assert store.get("a" * 64) is None
    assert store.lookup("a" * 64) is None


def test_interrupted_put_leaves_no_blob(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, data: bytes) -> None:
        del data
        raise Fault(f"{path}: full")

    monkeypatch.setattr(files_module, "write_atomically", full)
    with pytest.raises(Fault, match="full"):
        store.put(b"result")
    assert not store.has(sha256(b"result"))


def test_threads_may_put_the_same(store: Store) -> None:
    threads = [threading.Thread(target=lambda: [store.put(bytes(300_000)) for _ in range(10)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert store.get(sha256(bytes(300_000))) == bytes(300_000)
    assert len([path for path in root(store).rglob("*") if path.is_file()]) == 1
