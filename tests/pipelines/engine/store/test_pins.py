"""Pins keep the results of scans."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipelines.engine.actions.step import Step, Value
from pipelines.engine.audit import seal_store
from pipelines.engine.store.pins import pin, read_pins, unpin
from pipelines.engine.store.store import Store
from schemas.base.errors import DamagedError, RefusedInput


@pytest.fixture
def ran(package: Any, run_steps: Any) -> None:
    join = package.step_module("join")
    for scan in ("P/S", "P/S-2", "P-S/2", "demo"):
        run_steps(*(Step(scan, kind, join, None, {"x": Value(f"{scan}{kind}".encode())}) for kind in ("a", "b")))


@pytest.mark.usefixtures("ran")
def test_pinned_until_unpinned(store: Store) -> None:
    assert read_pins(store) == {}
    for scan in ("P/S", "demo", "P/S-2", "P-S/2"):
        assert pin(scan, store) == 2
        latest = {f"{scan}/{kind}": store.latest(f"{scan}/{kind}") for kind in ("a", "b")}
        assert read_pins(store)[scan] == {step: last.key for step, last in latest.items() if last is not None}
    unpin("P/S-2", store)
    assert set(read_pins(store)) == {"P/S", "demo", "P-S/2"}
    with pytest.raises(RefusedInput, match=r"P/S-2: is not pinned, expected a pinned scan: demo, P/S, P-S/2"):
        unpin("P/S-2", store)


@pytest.mark.usefixtures("ran")
@pytest.mark.parametrize("scan", ["", "../x", "P/../../x", "/etc", "P//S", "P/S\n"])
def test_a_name_leads_nowhere_else(store: Store, scan: str) -> None:
    for act in (pin, unpin):
        with pytest.raises(RefusedInput, match="expected 1 to 64 letters"):
            act(scan, store)


@pytest.mark.usefixtures("ran")
def test_a_scan_that_has_not_run(store: Store) -> None:
    with pytest.raises(RefusedInput, match=r"P/T: has no results in .*, expected a scan that was run"):
        pin("P/T", store)


@pytest.mark.usefixtures("ran")
def test_a_pin_of_a_sealed_store_bears_its_owners_seal(store: Store) -> None:
    owners = replace(store, secret=b"owner")
    pin("P/S", store)
    forged = store.files.read("pins/P/S.json")
    with pytest.raises(DamagedError):
        read_pins(owners)
    seal_store(owners, every=True)
    assert read_pins(owners) == {"P/S": {**read_pins(store)["P/S"]}}
    store.files.write("pins/P/S.json", forged)
    with pytest.raises(DamagedError):
        read_pins(owners)


@pytest.mark.usefixtures("ran")
def test_a_damaged_pin_is_a_fault(store: Store) -> None:
    pin("P/S", store)
    file = Path(store.files.path("pins/P/S.json"))
    whole = file.read_text()
    key = next(iter(read_pins(store)["P/S"].values()))
    for damaged in ("", "[]", "{}", whole[:-1], whole.replace(key, key[::-1]), whole.replace("P/S", "P/T")):
        file.write_text(damaged)
        with pytest.raises(DamagedError, match=r"P/S\.json: damaged, .*'footscan cache pin P/S' makes it anew"):
            read_pins(store)
    pin("P/S", store)
    assert len(read_pins(store)["P/S"]) == 2
