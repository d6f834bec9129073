"""A store whose rows lie in packs plans, collects garbage and is checked like any other."""

import time
import uuid
from pathlib import Path
from typing import Any

import pytest

from pipelines.engine.actions.step import Output, Step, Success, Value
from pipelines.engine.audit import verify
from pipelines.engine.files.names import blob_name
from pipelines.engine.files.places import RemoteFiles
from pipelines.engine.garbage_collection import delete, find_garbage, read_contents
from pipelines.engine.plan import State
from pipelines.engine.pool import StepEnd, Threads
from pipelines.engine.store.store import Store
from pipelines.engine.workspace import Workspace


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    for module in ("pipelines.engine.files.packs", "pipelines.engine.workspace"):
        monkeypatch.setattr(f"{module}.MANY", 2)
    return Workspace(tmp_path / "cache")


def steps(package: Any, film: bytes = b"film") -> list[Step]:
    first, second = (package.step_module(kind) for kind in ("first", "second"))
    return [
        Step("P/S", "first", first, None, {"film": Value(film)}),
        Step("P/S", "second", second, None, {"first": Output("P/S/first")}),
    ]


def run(workspace: Workspace, made: list[Step]) -> list[str]:
    """Kinds of the steps that ran."""
    ends: list[StepEnd] = []
    workspace.run(made, Threads(2), ends.append)
    return [end.step.kind for end in ends if end.ran]


def by_themselves(store: Store) -> list[str]:
    return [name for folder in ("actions", "latest") for name, _ in store.files.place.sizes(folder)]


def test_rows_are_packed_and_found_again(workspace: Workspace, package: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    assert run(workspace, steps(package)) == ["first", "second"]
    assert by_themselves(workspace.store) == []
    assert run(workspace, steps(package)) == []
    workspace.close()
    with Workspace(workspace.local) as later:
        assert {planned.state for planned in later.plan(steps(package)).steps} == {State.HIT}
        assert later.plan(steps(package, b"other")).steps[0].reason == "input film changed"
    monkeypatch.setattr(Store, "row", lambda *_: pytest.fail("a row in a pack that has not changed is not read again"))
    with Workspace(workspace.local) as later:
        assert later.plan(steps(package)).to_run == []


def test_what_another_process_packed_is_found(workspace: Workspace, package: Any) -> None:
    other = Workspace(workspace.local, workspace.local / "other")
    assert other.plan(steps(package)).to_run
    run(workspace, steps(package))
    assert other.plan(steps(package)).to_run == []


@pytest.mark.parametrize("is_packed", [False, True])
def test_a_store_at_a_url_is_listed_for_a_large_plan(
    package: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_packed: bool
) -> None:
    workspace = Workspace(f"memory://{uuid.uuid4().hex}", tmp_path)
    run(workspace, steps(package))
    run(workspace, steps(package, b"other"))
    if is_packed:
        files = workspace.store.files
        files.pack([name for folder in ("actions", "latest") for name, _ in files.place.sizes(folder)])
    workspace.plan(steps(package))
    workspace.close()
    monkeypatch.setattr("pipelines.engine.plan.MANY", 2)
    with monkeypatch.context() as patch:
        patch.setattr(RemoteFiles, "state", lambda *_: pytest.fail("no file is asked for by itself"))
        patch.setattr(Store, "row", lambda *_: pytest.fail("no row is read again"))
        planned = workspace.plan(steps(package))
    assert planned.to_run == []
    outcome = planned.steps[1].outcome
    assert isinstance(outcome, Success)
    workspace.store.files.remove(blob_name(outcome.digest))
    assert len(workspace.plan(steps(package)).to_run) == 2  # their results are equal, one blob


def test_a_new_machine_reads_a_pack_at_a_url_once(
    package: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = Workspace(f"memory://{uuid.uuid4().hex}", tmp_path / "one")
    run(workspace, steps(package))
    files = workspace.store.files
    files.pack([name for name, _ in files.place.sizes("actions")])
    monkeypatch.setattr("pipelines.engine.plan.MANY", 2)
    requests: list[str] = []
    read = RemoteFiles.read
    monkeypatch.setattr(RemoteFiles, "read", lambda self, name: (requests.append(name), read(self, name))[1])
    with Workspace(str(files.place.path("")).rstrip("/"), tmp_path / "two") as later:
        assert later.plan(steps(package)).to_run == []
    assert sorted(name.partition("/")[0] for name in requests) == ["blobs", "blobs", "packs"]


def test_garbage_in_packs_goes(workspace: Workspace, package: Any) -> None:
    run(workspace, steps(package))
    before = {name for name, _ in workspace.store.files.sizes("actions")}
    run(workspace, steps(package, b"other"))
    garbage = find_garbage(read_contents(workspace.store), workspace.store, now=time.time() + 1e6, older_than_s=1e3)
    assert delete(garbage, workspace.store)[0] == garbage.names
    assert len(before) == 2
    assert before <= set(garbage.names)
    assert not before & {name for name, _ in workspace.store.files.sizes("actions")}
    assert run(workspace, steps(package, b"other")) == []
    assert run(workspace, steps(package)) == ["first", "second"]


@pytest.mark.parametrize("is_table", [False, True])
def test_damage_in_a_pack_is_found_and_made_again(workspace: Workspace, package: Any, is_table: bool) -> None:
    run(workspace, steps(package))
    pack = workspace.local / next(name for name, _ in workspace.store.files.place.sizes("packs/actions"))
    data = bytearray(pack.read_bytes())
    data[0 if is_table else -3] ^= 1
    pack.write_bytes(data)
    with Workspace(workspace.local) as later:
        assert len(verify(later.store).damaged) == 1
        assert verify(later.store).damaged == []
        assert len(run(later, steps(package))) == (2 if is_table else 1)
        assert verify(later.store).damaged == []
