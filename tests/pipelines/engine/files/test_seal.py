"""Seals of rows, which only the owner of the secret can make."""

import json
import logging
import pickle
import sqlite3
from pathlib import Path

import pytest

from pipelines.cli.main import run_command
from pipelines.engine.actions.key import key_of
from pipelines.engine.audit import seal_store, verify
from pipelines.engine.files import secret as secret_file
from pipelines.engine.files.digest import sha256
from pipelines.engine.files.names import blob_name, row_name
from pipelines.engine.files.seal import seal_of, sealed, unsealed
from pipelines.engine.store.store import Row, Store, open_store
from pipelines.engine.store.verified_index import VerifiedRow
from schemas.base.errors import RefusedInput

IMAGE = {"step": "made_up", "inputs": {}}


@pytest.fixture(autouse=True)
def configuration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A configuration folder for this test."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.delenv(secret_file.VARIABLE, raising=False)
    return tmp_path / "config"


def opened(tmp_path: Path) -> Store:
    return open_store(tmp_path / "store", tmp_path / "store/known.sqlite")


def poison(tmp_path: Path, result: bytes, image: object = IMAGE) -> str:
    """Forge a row with write access to the store, but without the secret."""
    digest, key = sha256(result), key_of(image)
    for name, data in (
        (blob_name(digest), result),
        (row_name(key), sealed({"image": image, "digest": digest, "failure": None})),
    ):
        path = tmp_path / "store" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    return key


def test_a_poisoned_row_is_a_miss(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    store = opened(tmp_path)
    store.record("P/S/made_up", Row(IMAGE, store.put(b"right")))
    assert seal_store(store).sealed == 2  # the row, and that it is the last action
    store = opened(tmp_path)
    key = key_of(IMAGE)
    known = store.lookup(key)
    assert known is not None
    assert known.digest == sha256(b"right")
    assert store.latest("P/S/made_up") is not None
    assert caplog.messages == []
    poison(tmp_path, b"poison")
    store = opened(tmp_path)
    assert store.lookup(key) is None
    assert store.bears_no_seal(key)
    assert caplog.messages == [f"{store.files.path(row_name(key))}: bears no seal of its owner, will be made again"]
    assert verify(store).damaged == [store.files.path(row_name(key))]
    store.record("P/S/made_up", Row(IMAGE, store.put(b"right")))
    assert not store.bears_no_seal(key)
    assert (found := opened(tmp_path).lookup(key)) is not None
    assert found.digest == sha256(b"right")


@pytest.mark.parametrize("owner_seal", ["0" * 64, "", None, 1, "é", ["a"]])
def test_wrong_seals(tmp_path: Path, owner_seal: object) -> None:
    seal_store(opened(tmp_path))
    key = poison(tmp_path, b"poison")
    path = tmp_path / "store" / row_name(key)
    value = unsealed(path.read_bytes())
    path.write_bytes(sealed({**value, "owner_seal": owner_seal}))
    assert opened(tmp_path).lookup(key) is None


def test_the_seal_of_another_row_and_of_another_secret(tmp_path: Path) -> None:
    store = opened(tmp_path)
    seal_store(store)
    store = opened(tmp_path)
    store.record("P/S/made_up", Row(IMAGE, store.put(b"right")))
    good = json.loads((tmp_path / "store" / row_name(key_of(IMAGE))).read_bytes())
    other = {**IMAGE, "inputs": {"a": 1}}
    key = poison(tmp_path, b"poison", other)
    path = tmp_path / "store" / row_name(key)
    value = unsealed(path.read_bytes())
    for stolen in (good["owner_seal"], seal_of(value, b"\0" * secret_file.BYTES)):
        path.write_bytes(sealed({**value, "owner_seal": stolen}))
        assert opened(tmp_path).lookup(key) is None
    path.write_bytes(sealed({**value, "owner_seal": seal_of(value, store.secret or b"")}))
    assert opened(tmp_path).lookup(key) is not None


def test_what_a_machine_remembers_is_no_way_in(tmp_path: Path) -> None:
    """A forged entry of the index is not used, although the rows that it lists are not read."""
    store = opened(tmp_path)
    seal_store(store)
    key = poison(tmp_path, b"poison")
    plain = Store(store.files, opened(tmp_path).verified)
    assert plain.verified is not None
    plain.verified.secret = None
    state, blob = (store.files.state(name) for name in (row_name(key), blob_name(sha256(b"poison"))))
    plain.verified.put(key, VerifiedRow(str(state), sha256(b"poison"), None, None, blob))
    plain.verified.close()
    assert plain.lookup(key) is not None
    assert opened(tmp_path).lookup(key) is None
    with sqlite3.connect(tmp_path / "store/known.sqlite") as connection:
        connection.execute("UPDATE known SET seal = -1")
    connection.close()
    assert opened(tmp_path).lookup(key) is None


def test_a_second_seal_vouches_for_nothing(tmp_path: Path) -> None:
    store = opened(tmp_path)
    key = poison(tmp_path, b"mine, from before")
    assert vars(seal_store(store)) == {"sealed": 1, "unsealed": 0}
    poison(tmp_path, b"poison")
    assert vars(seal_store(opened(tmp_path))) == {"sealed": 0, "unsealed": 1}
    assert opened(tmp_path).lookup(key) is None
    assert vars(seal_store(opened(tmp_path), every=True)) == {"sealed": 1, "unsealed": 0}
    assert opened(tmp_path).lookup(key) is not None


def test_the_secret_is_its_owners_alone_and_does_not_travel(
    tmp_path: Path, configuration: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seal_store(opened(tmp_path))
    [secret] = configuration.rglob("*.key")
    store = opened(tmp_path)
    assert store.secret is not None
    assert [oct(path.stat().st_mode & 0o777) for path in (secret, secret.parent)] == ["0o600", "0o700"]
    for form in (pickle.dumps(store), repr(store).encode()):
        assert store.secret not in form
        assert store.secret.hex().encode() not in form
    assert pickle.loads(pickle.dumps(store)).secret == store.secret
    assert store.secret.hex() not in "".join(path.name for path in (tmp_path / "store").rglob("*"))
    secret.chmod(0o640)
    with pytest.raises(RefusedInput, match="can be read by others"):
        opened(tmp_path)
    secret.chmod(0o600)
    secret.write_text("words")
    with pytest.raises(RefusedInput, match="holds no secret, expected 64 hexadecimal digits"):
        opened(tmp_path)
    monkeypatch.setenv(secret_file.VARIABLE, str(tmp_path / "none"))
    with pytest.raises(RefusedInput, match="no such file, expected the secret that FOOTSCAN_SEAL_KEY names"):
        opened(tmp_path)


def test_the_commands(done: object, capsys: pytest.CaptureFixture[str]) -> None:
    """A store is sealed, poisoned, planned, and run again."""
    workflow = str(done.workflow)  # type: ignore[attr-defined]
    assert run_command(["cache", "seal", workflow]) == 0
    assert " rows sealed, 0 without the seal\nsecret: " in capsys.readouterr().out
    assert run_command(["plan", workflow, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["misses"] == []
    actions = Path(done.root) / "results/.footscan/actions"  # type: ignore[attr-defined]
    rows = {path: unsealed(path.read_bytes()) for path in sorted(actions.rglob("*.json"))}
    [(path, value)] = [(path, value) for path, value in rows.items() if '"measure"' in json.dumps(value["image"])][:1]
    path.write_bytes(sealed(value))  # no secret is needed for that
    assert run_command(["plan", workflow, "--json"]) == 0
    reasons = [miss["reason"] for miss in json.loads(capsys.readouterr().out)["misses"]]
    assert "its row bears no seal of the store's owner" in reasons
    assert run_command(["cache", "seal", workflow, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["unsealed"] == 1
    assert run_command(["cache", "verify", workflow]) == 1
    assert "1 damaged" in capsys.readouterr().out
    assert run_command(["run", workflow]) == 0
    capsys.readouterr()
    assert run_command(["plan", workflow, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["misses"] == []
