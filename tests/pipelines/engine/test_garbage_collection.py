"""Garbage collection deletes what nothing needs, and nothing else."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from pipelines.engine.actions.step import Output, Step, Value
from pipelines.engine.audit import repeatable
from pipelines.engine.files.names import blob_name, row_name
from pipelines.engine.garbage_collection import CODE, VALUES, Garbage, delete, find_garbage, read_contents
from pipelines.engine.plan import make_plan
from pipelines.engine.store.lease import lease
from pipelines.engine.store.pins import pin, unpin
from pipelines.engine.store.store import Store, open_store
from schemas.base.errors import DamagedError
from schemas.base.model import Document

DAY_S = 86400.0
JOIN_AGAIN = """
def run(inputs, parameters, places):
    return b"+".join(inputs[name] for name in sorted(inputs)) + b"*" + str(parameters.factor).encode()
"""


class Factor(Document):
    factor: int


Chain = Callable[..., list[Step]]


@pytest.fixture
def chain(package: Any) -> Chain:
    """first(film) -> second(first, remark); second has a parameter."""
    modules = [package.step_module("first"), package.step_module("second", JOIN_AGAIN)]

    def draw(factor: int = 2, film: bytes = b"film", remark: bytes = b"remark") -> list[Step]:
        inputs = {"first": Output("P/S/first"), "remark": Value(remark)}
        return [
            Step("P/S", "first", modules[0], None, {"film": Value(film)}),
            Step("P/S", "second", modules[1], Factor(factor=factor), inputs),
        ]

    return draw


def garbage(store: Store, *delivered: str, days: float = 2.0) -> Garbage:
    """The garbage after this number of days."""
    now = time.time() + days * DAY_S
    return find_garbage(read_contents(store), store, delivered=delivered, now=now, older_than_s=DAY_S)


def files(store: Store) -> set[str]:
    return {name for name, _ in store.files.sizes("")}


def hits(store: Store, steps: list[Step]) -> list[bool]:
    return [planned.outcome is not None for planned in make_plan(steps, store).steps]


def test_what_ran_last_is_kept_and_what_ran_before_goes(chain: Chain, store: Store, run_steps: Any) -> None:
    old, _ = run_steps(*chain(2, remark=b"old"))
    before = files(store)
    new, _ = run_steps(*chain(3))
    unneeded = garbage(store)
    assert unneeded.young == []
    first, second = unneeded.names[0], unneeded.names[1:]
    assert first.startswith("actions/")
    assert set(second) == {blob_name(old["second"].digest), blob_name(Value(b"old").digest)}
    assert set(unneeded.names) <= before
    assert delete(unneeded, store) == (unneeded.names, [])
    assert files(store).isdisjoint(unneeded.names)
    assert hits(store, chain(3)) == [True, True]
    assert hits(store, chain(2, remark=b"old")) == [True, False]
    assert store.get(new["second"].digest) == b"film+remark*3"
    assert garbage(store) == Garbage()


def test_code_goes_with_the_last_action_that_it_was_of(
    chain: Chain, store: Store, run_steps: Any, package: Any
) -> None:
    steps = chain()
    run_steps(*steps)
    package.write("second", (package.folder / "second.py").read_text() + "\nX = 1\n")
    package.forget()
    run_steps(*steps)
    shares = read_contents(store).shares(garbage(store).names)
    assert {kind: (share.actions, share.results) for kind, share in shares.items()} == {CODE: (0, 2), "second": (1, 0)}
    delete(garbage(store), store)
    package.write("second", (package.folder / "second.py").read_text() + "\nX = 2\n")
    package.forget()
    assert make_plan(steps, store).steps[1].reason == f"code of {package.name}.second changed"


def test_nothing_young_goes(chain: Chain, store: Store, run_steps: Any) -> None:
    run_steps(*chain(2))
    run_steps(*chain(3))
    unneeded = garbage(store, days=0.9)
    assert (unneeded.names, len(unneeded.young)) == ([], 2)
    assert garbage(store, days=1.1).young == []


def test_pins_keep_all_that_they_reach(chain: Chain, store: Store, run_steps: Any) -> None:
    run_steps(*chain(2, b"old film"))
    pin("P/S", store)
    run_steps(*chain(3))
    assert garbage(store) == Garbage()
    unpin("P/S", store)
    assert len(garbage(store).names) == 4  # two rows, two results; the old film is the result of first, too
    pin("P/S", store)
    Path(store.files.path("pins/P/S.json")).write_bytes(b"{}")
    with pytest.raises(DamagedError, match=r"pins/P/S\.json: damaged"):
        garbage(store)


def test_what_a_last_action_took_is_kept_though_its_step_has_gone_on(
    chain: Chain, store: Store, run_steps: Any
) -> None:
    old, _ = run_steps(*chain())
    run_steps(chain(film=b"other film")[0])  # interrupted after this step
    assert garbage(store) == Garbage()
    assert store.get(old["first"].digest) == b"film"


def test_what_lies_in_the_results_is_kept(chain: Chain, store: Store, run_steps: Any) -> None:
    old, _ = run_steps(*chain(2, b"old film"))
    run_steps(*chain(3))
    run_steps(*chain(2, b"old film"))  # known: no step's last action is changed
    assert len(garbage(store).names) == 4
    assert garbage(store, old["second"].digest) == Garbage()
    assert len(garbage(store, "0" * 64).names) == 4  # a key of no step
    keys = repeatable(make_plan(chain(2, b"old film"), store), store)
    in_use = find_garbage(read_contents(store), store, keys=keys, now=time.time() + 2 * DAY_S, older_than_s=DAY_S)
    assert in_use == Garbage()


def test_what_was_killed_leaves_parts_that_go(chain: Chain, store: Store, run_steps: Any) -> None:
    run_steps(*chain())
    row = next(name for name in files(store) if name.startswith("actions/"))
    folder = row.rpartition("/")[0]
    parts = {f"{folder}/.x.json.1-2.partial", ".files.json.1-2.partial", "blobs/ab/.x.1-2.partial"}
    for name in (*parts, "actions/.keep", "blobs/README", "mine/.x.partial", "files.json", "known.sqlite"):
        store.files.write(name, b"x")
    assert set(garbage(store).names) == parts
    assert garbage(store, days=0.5).names == []


def test_a_run_under_way_keeps_all(chain: Chain, store: Store, run_steps: Any) -> None:
    run_steps(*chain(2))
    run_steps(*chain(3))
    unneeded, before = garbage(store), files(store)
    with lease(store):
        deleted, [live] = delete(unneeded, store)
        assert (deleted, live.process is not None) == ([], True)
        assert files(store) - {live.name} == before
    assert delete(unneeded, store) == (unneeded.names, [])


def test_a_run_that_begins_while_garbage_is_deleted_stops_it(
    chain: Chain, store: Store, monkeypatch: pytest.MonkeyPatch, run_steps: Any
) -> None:
    run_steps(*chain(2))
    run_steps(*chain(3))
    unneeded = garbage(store)
    monkeypatch.setattr("pipelines.engine.garbage_collection.CHECK_EVERY", 1)
    original = type(store.files).remove_all
    with ExitStack() as runs:

        def remove_all(files: Any, names: Any) -> None:
            original(files, names)
            runs.enter_context(lease(store))

        monkeypatch.setattr(type(store.files), "remove_all", remove_all)
        deleted, live = delete(unneeded, store)
        monkeypatch.setattr(type(store.files), "remove_all", original)
    assert deleted == unneeded.names[:1]
    assert len(live) == 1
    assert store.files.state(unneeded.names[1]) is not None


def test_the_lease_of_a_dead_run_goes_and_a_live_one_stays(store: Store) -> None:
    store.files.write("runs/h-1-ab.json", b'{"heartbeat":1.0,"host":"h","process":1,"started":1.0}')
    with lease(store):
        assert garbage(store).names == ["runs/h-1-ab.json"]


def test_shares_by_kind(chain: Chain, store: Store, run_steps: Any) -> None:
    outcomes, _ = run_steps(*chain(2))
    contents = read_contents(store)
    shares = contents.shares(contents.sizes)
    assert {kind: (share.actions, share.results) for kind, share in shares.items()} == {
        CODE: (0, 4), VALUES: (0, 1), "first": (1, 1), "second": (1, 1), "(other)": (0, 0),
    }  # fmt: skip  # the film is equal to the result of first; code: two documents and two modules
    row = contents.sizes[
        next(row_name(key) for key, row in contents.actions.rows.items() if row.image["step"] == "second")
    ]
    assert shares["second"].bytes == row + len(b"film+remark*2")
    assert sum(share.bytes for share in shares.values()) == sum(size for _, size in store.files.sizes(""))
    assert store.has(outcomes["first"].digest)


def test_when_a_file_was_written(store: Store) -> None:
    for opened in (store, open_store("memory://collect-test")):
        before = time.time() - 1
        digest = opened.put(b"x")
        written = opened.files.written(blob_name(digest))
        assert written is not None
        assert before <= written <= time.time() + 1
        assert opened.files.written(blob_name("0" * 64)) is None


def test_a_store_elsewhere(chain: Chain, run_steps: Any, store: Store) -> None:
    run_steps(*chain(2))
    run_steps(*chain(3))
    elsewhere = open_store("memory://collect-elsewhere")
    for name in files(store):
        elsewhere.files.write(name, store.files.read(name))
    unneeded = garbage(elsewhere)
    assert unneeded == garbage(store)
    delete(unneeded, elsewhere)
    assert files(elsewhere) == files(store) - set(unneeded.names)


def test_an_empty_store(store: Store) -> None:
    assert garbage(store) == garbage(open_store("memory://collect-nothing")) == Garbage()
