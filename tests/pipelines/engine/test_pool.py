"""Threads, processes and a cluster give the same results; a dying worker costs only its own task."""

import platform
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from pipelines.engine.actions.step import Failure, Output, Step, Success, Value
from pipelines.engine.plan import make_plan
from pipelines.engine.pool import ARENAS, Cluster, StepEnd, Threads, joined_cluster, local_cluster
from pipelines.engine.run import run_plan
from pipelines.engine.store.store import Store, open_store
from schemas.base.errors import RefusedInput

JOIN = "def run(inputs, parameters, places):\n    return b'+'.join(inputs[name] for name in sorted(inputs))\n"
KILLS = "import os, signal\ndef run(inputs, parameters, places):\n    os.kill(os.getpid(), signal.SIGKILL)\n"
KILLS_ONCE = """
import os, signal
def run(inputs, parameters, places):
    if not places["mark"].exists():
        places["mark"].touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return b"alive"
"""
FAILS = (
    "from schemas.base.errors import Finding\ndef run(inputs, parameters, places):\n    raise Finding('no stripe')\n"
)
HEAPS_OF_THREADS = """
import ctypes, sys, threading
from pipelines.engine.pool import Threads
Threads(2).run({}, None, None)
def hold():
    held = [bytes(10_000) for _ in range(100)]
    met.wait()
met = threading.Barrier(9)
for _ in range(8):
    threading.Thread(target=hold).start()
libc = ctypes.CDLL(None)
libc.fdopen.restype = ctypes.c_void_p
libc.malloc_info(0, ctypes.c_void_p(libc.fdopen(1, b"w")))
met.wait()
libc.fflush(None)
"""
MODULES = {"join": JOIN, "killer": KILLS, "frail": KILLS_ONCE, "failing": FAILS}


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """Two processes that find the modules of the steps."""
    folder = tmp_path_factory.mktemp("modules")
    for name, source in MODULES.items():
        (folder / f"step_of_pool_{name}.py").write_text(source)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        patch.setenv("PYTHONPATH", str(folder))
        with local_cluster(2) as cluster:
            yield cluster


def draw(scan: str = "P/S", first: str = "join", **places: Any) -> list[Step]:
    """The steps of a scan: two cameras, their join, and one step after it."""
    join = "step_of_pool_join"
    return [
        Step(scan, "extract", f"step_of_pool_{first}", None, {"film": Value(scan.encode())}, 1, places=places),
        Step(scan, "extract", join, None, {"film": Value(b"b")}, 2),
        Step(scan, "fuse", join, None, {f"p{n}": Output(f"{scan}/extract-{n}") for n in (1, 2)}),
        Step(scan, "measure", join, None, {"fused": Output(f"{scan}/fuse")}),
    ]


def run(steps: list[Step], store: Store, pool: Any) -> tuple[dict[str, Any], list[StepEnd]]:
    ends: list[StepEnd] = []
    return run_plan(make_plan(steps, store), store, pool=pool, on_step_end=ends.append), ends


def test_processes_give_what_threads_give(store: Store, tmp_path: Any, cluster: Cluster) -> None:
    steps = draw("P/S") + draw("P/T")
    expected, _ = run(steps, store, Threads(2))
    elsewhere = open_store(tmp_path / "elsewhere")
    outcomes, ends = run(steps, elsewhere, cluster)
    assert outcomes == expected
    assert all(isinstance(outcome, Success) for outcome in outcomes.values())
    assert sorted(end.step.name for end in ends) == sorted(step.name for step in steps)
    assert all(end.ran or end.step.camera == 2 for end in ends)  # that of both scans is the same
    files = [{name: data.files.read(name) for name, _ in data.files.sizes("")} for data in (store, elsewhere)]
    assert files[0] == files[1]
    assert run(steps, elsewhere, cluster) == (expected, [])


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="heaps of glibc's malloc")
def test_threads_share_their_heaps() -> None:
    report = subprocess.run([sys.executable, "-c", HEAPS_OF_THREADS], capture_output=True, text=True, check=True).stdout

    assert 1 <= report.count("<heap nr=") <= ARENAS


def test_failures_travel(store: Store, cluster: Cluster) -> None:
    steps = draw(first="failing")
    failure = Failure("no stripe", "finding", "P/S/extract-1")
    outcomes, _ = run(steps, store, cluster)
    assert outcomes["P/S/measure"] == outcomes["P/S/fuse"] == outcomes["P/S/extract-1"] == failure
    assert isinstance(outcomes["P/S/extract-2"], Success)


def test_a_worker_that_dies_costs_its_own_task_which_is_tried_again(
    store: Store, cluster: Cluster, tmp_path: Any
) -> None:
    steps = draw(first="frail", mark=tmp_path / "mark")
    outcomes, _ = run(steps, store, cluster)
    measure = outcomes["P/S/measure"]
    assert isinstance(measure, Success)
    assert store.get(measure.digest) == b"alive+b"


def test_a_task_that_kills_workers_is_given_up_and_costs_no_other_scan(store: Store, cluster: Cluster) -> None:
    steps = draw("P/bad", first="killer") + draw("P/good")
    outcomes, ends = run(steps, store, cluster)
    assert isinstance(outcomes["P/good/measure"], Success)
    failure = outcomes["P/bad/measure"]
    assert failure == outcomes["P/bad/fuse"] == outcomes["P/bad/extract-1"]
    assert (failure.kind, failure.cause) == ("fault", "P/bad/extract-1")
    assert re.fullmatch(
        r"P/bad/extract-1: killed 2 workers(, the last one when it held \d+ MB)?; given up", failure.problem
    )
    assert len(ends) == len(steps)
    assert store.latest("P/bad/extract-1") is None


def test_other_code_elsewhere_is_a_fault_and_nothing_is_recorded(store: Store, cluster: Cluster) -> None:
    class OldPlan:
        count = 2

        def run(self, tasks: Any, *others: Any) -> Any:
            return cluster.run({name: replace(task, code="0" * 64) for name, task in tasks.items()}, *others)

    outcomes, _ = run(draw(), store, OldPlan())
    assert {outcome.kind for outcome in outcomes.values()} == {"fault"}
    assert "has another version of footscan" in outcomes["P/S/extract-1"].problem
    assert store.latest("P/S/extract-1") is None


def test_a_scheduler_that_does_not_answer_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipelines.engine.pool.ANSWER_S", 0.2)
    with pytest.raises(RefusedInput, match=r"^--cluster tcp://127.0.0.1:9: no Dask scheduler answers"):
        joined_cluster("tcp://127.0.0.1:9").__enter__()
    with pytest.raises(RefusedInput, match=r"^--cluster nonsense://x: no Dask scheduler answers"):
        joined_cluster("nonsense://x").__enter__()
