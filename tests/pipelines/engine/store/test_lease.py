"""Leases announce runs under way to all users of the store."""

import json
import logging
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from pipelines.engine.store import lease as lease_module
from pipelines.engine.store.lease import STALE_S, is_ahead, lease, leases, live_leases, take_over
from pipelines.engine.store.store import Store
from schemas.base.model import canonical_json


def test_a_lease_lasts_as_long_as_its_run(store: Store) -> None:
    assert leases(store) == []
    before = time.time()
    with lease(store), lease(store):
        held, other = live_leases(store)
        assert held.name != other.name
        assert held.process == other.process == os.getpid()
        assert held.started is not None
        assert before <= held.started <= time.time()
    assert leases(store) == []
    assert not [thread for thread in threading.enumerate() if thread.name == "lease"]


def test_it_ends_with_a_run_that_fails(store: Store) -> None:
    with pytest.raises(KeyboardInterrupt), lease(store):
        raise KeyboardInterrupt
    assert leases(store) == []


def test_its_heart_beats(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lease_module, "HEARTBEAT_S", 0.02)
    with lease(store):
        [first] = leases(store)
        assert first.heartbeat is not None
        give_up = time.monotonic() + 10
        while (leases(store)[0].heartbeat or 0) <= first.heartbeat:
            assert time.monotonic() < give_up, "no heartbeat"
            time.sleep(0.01)
        assert leases(store)[0].started == first.started


def write(store: Store, age_s: float) -> None:
    beat = time.time() - age_s
    document = {"host": "h", "process": 7, "started": beat - 60.0, "heartbeat": beat}
    store.files.write("runs/h-7-ab.json", canonical_json(document).encode())


def test_without_a_heartbeat_a_run_is_taken_for_dead(store: Store) -> None:
    write(store, STALE_S - 60)
    assert len(live_leases(store)) == 1
    write(store, STALE_S + 1)
    assert (len(leases(store)), live_leases(store)) == (1, [])


def test_a_run_that_was_killed_on_this_machine_is_known_to_be_dead(store: Store) -> None:
    if not Path("/proc/sys/kernel/random/boot_id").exists():
        pytest.skip("only Linux tells")
    hold = "import sys, time\nfrom pipelines.engine.store.lease import lease\n"
    hold += "from pipelines.engine.store.store import open_store\n"
    hold += "with lease(open_store(sys.argv[1])): print('held', flush=True); time.sleep(60)"
    process = subprocess.Popen([sys.executable, "-c", hold, store.files.path("")], stdout=subprocess.PIPE)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == b"held\n"
        [held] = live_leases(store)
        process.kill()
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        assert live_leases(store) == []  # though its number is not free yet
    finally:
        process.kill()
        process.communicate()
    assert (len(leases(store)), live_leases(store)) == (1, [])
    facts = json.loads(store.files.read(held.name))
    for others, alive in (({"system": "another"}, 1), ({"process": os.getpid()}, 0), ({"system": None}, 1)):
        store.files.write(held.name, canonical_json({**facts, **others}).encode())
        assert len(live_leases(store)) == alive, others


@pytest.mark.parametrize("damaged", [b"", b"[]", b"{}", b'{"host":1}', b"\xff", b"[" * 100_000])
def test_a_damaged_lease_may_be_a_run(store: Store, damaged: bytes) -> None:
    store.files.write("runs/h-7-ab.json", damaged)
    [held] = live_leases(store)
    assert (held.name, held.host, held.started) == ("runs/h-7-ab.json", None, None)


def test_a_store_that_cannot_be_written_to_does_not_keep_a_run_from_trying(
    store: Store, caplog: pytest.LogCaptureFixture
) -> None:
    Path(store.files.path("")).write_text("in the way")
    with caplog.at_level(logging.WARNING), lease(store):
        pass
    assert "cannot be written" in caplog.text


def test_a_lease_from_the_future_can_be_taken_over(store: Store) -> None:
    write(store, -86400.0)
    [held] = live_leases(store)
    assert is_ahead(held)
    assert take_over(store) == [held]
    assert leases(store) == []


def test_a_lease_of_another_host_can_be_taken_over_but_none_of_a_process_that_is_seen_here(store: Store) -> None:
    if not Path("/proc/sys/kernel/random/boot_id").exists():
        pytest.skip("only Linux tells")
    write(store, 5.0)
    [other] = live_leases(store)
    assert not is_ahead(other)
    with lease(store) as name:
        assert take_over(store) == [other]
        assert [held.name for held in live_leases(store)] == [name]


def test_a_run_whose_lease_was_taken_over_announces_itself_again(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lease_module, "HEARTBEAT_S", 0.02)
    with lease(store) as name:
        store.files.remove(name)
        give_up = time.monotonic() + 10
        while not live_leases(store):
            assert time.monotonic() < give_up, "not written again"
            time.sleep(0.01)


@pytest.mark.parametrize("time_s", ["Infinity", "NaN", "1e300", "-1.0"])
def test_a_lease_of_no_time_is_damaged(store: Store, time_s: str) -> None:
    store.files.write("runs/h-7-ab.json", f'{{"host":"h","process":7,"started":1.0,"heartbeat":{time_s}}}'.encode())
    [held] = live_leases(store)
    assert held.host is None
