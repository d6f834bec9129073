"""Only misses run; failures of the input are cached, faults of the machine are not."""

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipelines.engine.actions.key import key_of
from pipelines.engine.actions.step import Failure, Output, SourceFile, Step, Success, Value
from pipelines.engine.files.file_digests import FileDigests
from pipelines.engine.files.names import blob_name
from pipelines.engine.plan import make_plan
from pipelines.engine.pool import StepEnd, Threads
from pipelines.engine.run import run_plan
from pipelines.engine.store.store import Row, Store
from schemas.base.errors import Fault
from schemas.base.model import Document

RunSteps = Callable[..., Any]


class Factor(Document):
    factor: int


def raising(error: str) -> str:
    return f"from schemas.base.errors import *\ndef run(inputs, parameters, places):\n    raise {error}\n"


@pytest.fixture
def diamond(package: Any) -> Callable[..., list[Step]]:
    """left(a), right(b), and both(left, right)."""
    module = package.step_module("join")

    def draw(a: bytes = b"a", b: bytes = b"b", left: Any = None, right: Any = None) -> list[Step]:
        return [
            Step("P/S", "left", left or module, None, {"a": Value(a)}),
            Step("P/S", "right", right or module, Factor(factor=2), {"b": Value(b)}),
            Step("P/S", "both", module, None, {"l": Output("P/S/left"), "r": Output("P/S/right")}),
        ]

    return draw


def source_file(path: Path) -> SourceFile:
    digest, state = FileDigests(path.parent / "files.json").of(path)
    return SourceFile(path, digest, ((path, state),))


@pytest.mark.parametrize("workers", [1, 2, 8])
def test_only_misses_run(diamond: Any, store: Store, run_steps: RunSteps, workers: int) -> None:
    outcomes, ran = run_steps(*diamond(), workers=workers)
    assert ran == ["both", "left", "right"]
    assert store.get(outcomes["both"].digest) == b"a+b*2"
    again, ran = run_steps(*diamond(), workers=workers)
    assert (again, ran) == (outcomes, [])
    outcomes, ran = run_steps(*diamond(b=b"B"), workers=workers)
    assert ran == ["both", "right"]
    assert store.get(outcomes["both"].digest) == b"a+B*2"


def test_same_result_stops_the_change(package: Any, store: Store, run_steps: RunSteps) -> None:
    length = package.step_module("length", "def run(inputs, *_):\n    return str(len(inputs['film'])).encode()\n")
    join = package.step_module("join")

    def steps(film: bytes) -> list[Step]:
        return [
            Step("P/S", "length", length, None, {"film": Value(film)}),
            Step("P/S", "join", join, None, {"length": Output("P/S/length")}),
        ]

    run_steps(*steps(b"abc"))
    plan = make_plan(steps(b"xyz"), store)
    assert [planned.state.value for planned in plan.steps] == ["miss", "waits"]
    ends: list[StepEnd] = []
    outcomes = run_plan(plan, store, pool=Threads(1), on_step_end=ends.append)
    assert [(end.step.kind, end.ran) for end in ends] == [("length", True), ("join", False)]
    assert outcomes["P/S/join"] == make_plan(steps(b"abc"), store).steps[1].outcome
    assert run_steps(*steps(b"xyz"))[1] == []


@pytest.mark.parametrize(
    ("error", "problem", "kind"),
    [
        ("Finding('no stripe in camera 3')", "no stripe in camera 3", "finding"),
        ("RefusedInput('cam1.avi', 'truncated', field='frames')", "cam1.avi: frames: truncated", "refused"),
    ],
)
def test_failures_by_input_are_remembered_and_spread(
    diamond: Any, package: Any, run_steps: RunSteps, error: str, problem: str, kind: str
) -> None:
    steps = diamond(left=package.step_module("bad", raising(error)))
    failure = Failure(problem, kind, "P/S/left")
    outcomes, ran = run_steps(*steps)
    assert ran == ["left", "right"]
    assert outcomes["left"] == outcomes["both"] == failure
    assert isinstance(outcomes["right"], Success)
    assert run_steps(*steps) == (outcomes, [])
    assert run_steps(*diamond())[1] == ["both", "left"]  # with other code it is another action


@pytest.mark.parametrize(
    ("error", "problem", "kind"),
    [
        ("Fault('disk full')", "disk full", "fault"),
        ("DamagedError('cam1: frame 2 is damaged')", "cam1: frame 2 is damaged", "damaged"),
        ("ZeroDivisionError('by\\nzero')", "P/S/left: ZeroDivisionError: by zero", "fault"),
        ("MemoryError()", "P/S/left: MemoryError:", "fault"),
        ("OSError(28, 'No space left on device')", "P/S/left: OSError: [Errno 28] No space left on device", "fault"),
    ],
)
def test_faults_are_not_remembered_and_cost_only_what_stands_behind(
    diamond: Any, package: Any, store: Store, run_steps: RunSteps, error: str, problem: str, kind: str
) -> None:
    steps = diamond(left=package.step_module("bad", raising(error)))
    failure = Failure(problem, kind, "P/S/left", is_defect="ZeroDivision" in error)
    for _ in range(2):
        outcomes, ran = run_steps(*steps)
        assert "left" in ran
        assert outcomes["left"] == outcomes["both"] == failure
        assert isinstance(outcomes["right"], Success)
    assert store.latest("P/S/left") is None


def test_result_that_is_no_bytes_is_a_fault_of_its_step(diamond: Any, package: Any, run_steps: RunSteps) -> None:
    outcomes, _ = run_steps(*diamond(left=package.step_module("bad", "def run(*_):\n    return None\n")))
    assert outcomes["left"].kind == "fault"
    assert isinstance(outcomes["right"], Success)


@pytest.mark.parametrize("error", ["Finding('x')", None])
def test_full_disk_is_a_fault_of_each_step_whether_it_failed_or_not(
    diamond: Any, package: Any, run_steps: RunSteps, monkeypatch: pytest.MonkeyPatch, error: str | None
) -> None:
    def full(_: Store, step_name: str, row: Row, _sources: object) -> None:
        raise Fault(f"{step_name}: disk full, {row.digest}")

    monkeypatch.setattr(Store, "record", full)
    left = package.step_module("bad", raising(error)) if error else None
    outcomes, _ = run_steps(*diamond(left=left))
    assert (outcomes["left"].kind, outcomes["right"].kind) == ("fault", "fault")
    assert outcomes["both"].problem.startswith("P/S/left: disk full, ")


def test_row_is_written_after_its_result(diamond: Any, run_steps: RunSteps) -> None:
    recorded = []
    original = Store.record

    def record(self: Store, step_name: str, row: Row, sources: dict[str, str]) -> None:
        assert row.digest is not None
        assert self.get(row.digest) is not None
        assert self.lookup(key_of(row.image)) is None
        recorded.append(step_name)
        original(self, step_name, row, sources)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Store, "record", record)
        run_steps(*diamond())
    assert len(recorded) == 3


def test_damaged_result_is_noticed_by_the_plan_and_made_anew(
    diamond: Any, store: Store, run_steps: RunSteps, caplog: pytest.LogCaptureFixture
) -> None:
    outcomes, _ = run_steps(*diamond())
    store.files.write(blob_name(outcomes["left"].digest), b"A")
    with caplog.at_level(logging.WARNING):
        mended, ran = run_steps(*diamond(b=b"B"))
    assert "damaged, will be made again" in caplog.text
    assert ran == ["both", "left", "right"]
    assert store.get(mended["both"].digest) == b"a+B*2"
    assert store.get(outcomes["left"].digest) == b"a"


def test_result_that_is_damaged_after_the_plan_is_made_anew_by_the_next(
    diamond: Any, store: Store, run_steps: RunSteps
) -> None:
    outcomes, _ = run_steps(*diamond())
    changed = diamond(b=b"B")
    plan = make_plan(changed, store)
    store.files.write(blob_name(outcomes["left"].digest), b"A")
    both = run_plan(plan, store, pool=Threads(2), on_step_end=lambda _: None)["P/S/both"]
    assert isinstance(both, Failure)
    assert both.kind == "damaged"
    assert both.problem == "P/S/both: the result of P/S/left is damaged, expected what was stored"
    mended, ran = run_steps(*changed)
    assert ran == ["both", "left"]
    assert store.get(mended["both"].digest) == b"a+B*2"


@pytest.mark.parametrize("change", ["write", "remove", "touch"])
@pytest.mark.parametrize("end", ["return b''", "raise RefusedInput(places['film'], 'truncated')", "raise Finding('x')"])
def test_file_that_changes_while_it_is_read_is_noticed(
    package: Any, tmp_path: Path, store: Store, run_steps: RunSteps, change: str, end: str
) -> None:
    film = tmp_path / "film.avi"
    film.write_bytes(b"frames")
    act = {
        "write": "places['film'].write_bytes(b'Frames')",
        "remove": "places['film'].unlink()",
        "touch": "os.utime(places['film'], ns=(0, 0))",
    }[change]
    source = (
        f"import os\nfrom schemas.base.errors import *\ndef run(inputs, parameters, places):\n    {act}\n    {end}\n"
    )
    module = package.step_module("reader", source)
    step = Step("P/S", "read", module, None, {"film": source_file(film)}, places={"film": film})
    outcomes, _ = run_steps(step)
    assert outcomes["read"] == Failure(
        f"{film}: changed while it was read, expected a finished file", "fault", step.name
    )
    assert store.latest(step.name) is None


def test_file_that_stays_is_handed_over_by_its_place(
    package: Any, tmp_path: Path, store: Store, run_steps: RunSteps
) -> None:
    film = tmp_path / "film.avi"
    film.write_bytes(b"frames")
    module = package.step_module(
        "reader", "def run(inputs, parameters, places):\n    return places['film'].read_bytes()"
    )
    step = Step("P/S", "read", module, None, {"film": source_file(film)}, places={"film": film})
    outcomes, _ = run_steps(step)
    assert store.get(outcomes["read"].digest) == b"frames"


def test_step_whose_file_is_gone_runs_again(package: Any, tmp_path: Path, run_steps: RunSteps) -> None:
    source = "def run(inputs, parameters, places):\n    places['array'].write_bytes(b'x')\n    return b'manifest'"
    module, array = package.step_module("writer", source), tmp_path / "array"
    step = Step("P/S", "ingest", module, None, {"film": Value(b"")}, places={"array": array}, writes=array)
    behind = Step("P/S", "behind", package.step_module("join"), None, {"x": Output("P/S/ingest")})
    assert run_steps(step, behind)[1] == ["behind", "ingest"]
    assert run_steps(step, behind)[1] == []
    array.unlink()
    assert run_steps(step, behind)[1] == ["ingest"]
    assert array.exists()


def test_failure_that_wrote_no_file_is_remembered_and_names_its_own_film(
    package: Any, tmp_path: Path, run_steps: RunSteps
) -> None:
    module = package.step_module("bad", raising("RefusedInput(places['film'], 'truncated')"))
    [one, other] = [
        Step(
            f"P/{name}", "ingest", module, None, {"film": Value(b"")},
            places={"film": tmp_path / name / "cam1.avi"}, writes=tmp_path / name / "zarr.json",
        )
        for name in ("one", "other")
    ]  # fmt: skip
    outcomes, ran = run_steps(one)
    assert (outcomes["ingest"].problem, ran) == (f"{tmp_path / 'one/cam1.avi'}: truncated", ["ingest"])
    assert run_steps(one) == (outcomes, [])
    outcomes, ran = run_steps(other)
    assert (outcomes["ingest"].problem, ran) == (f"{tmp_path / 'other/cam1.avi'}: truncated", [])
    assert outcomes["ingest"].cause == "P/other/ingest"


def test_scans_do_not_cost_each_other(package: Any, store: Store) -> None:
    good, bad = package.step_module("join"), package.step_module("bad", raising("RuntimeError('boom')"))
    steps = [
        Step(f"P/{number}", kind, bad if number % 7 == 3 and kind == "a" else good, None, inputs)
        for number in range(40)
        for kind, inputs in (
            ("a", {"x": Value(str(number).encode())}),
            ("b", {"a": Output(f"P/{number}/a")}),
        )
    ]
    outcomes = run_plan(make_plan(steps, store), store, pool=Threads(4), on_step_end=lambda _: None)
    for number in range(40):
        outcome = outcomes[f"P/{number}/b"]
        if number % 7 == 3:
            assert isinstance(outcome, Failure)
            assert outcome.cause == f"P/{number}/a"
        else:
            assert isinstance(outcome, Success)
            assert store.get(outcome.digest) == str(number).encode()


def test_code_that_was_changed_and_back_hits_again(package: Any, run_steps: RunSteps) -> None:
    def step(extra: str) -> Step:
        source = "def run(inputs, parameters, places):\n    return b'same'\n"
        return Step("P/S", "a", package.step_module("a", source + extra), None, {"x": Value(b"")})

    assert run_steps(step(""))[1] == ["a"]
    assert run_steps(step("X = 1\n"))[1] == ["a"]
    assert run_steps(step("# only a remark\n"))[1] == []


NOT_DETERMINISTIC = "import time\ndef run(*_):\n    return str(time.perf_counter_ns()).encode()\n"


def test_warns_of_a_result_that_differs_from_the_earlier_one(
    package: Any, store: Store, run_steps: RunSteps, caplog: pytest.LogCaptureFixture
) -> None:
    step = Step("P/S", "odd", package.step_module("odd", NOT_DETERMINISTIC))
    (first, _) = run_steps(step)
    assert not caplog.records
    store.files.remove(blob_name(first["odd"].digest))
    (second, ran) = run_steps(step)
    assert ran == ["odd"]
    assert second != first
    (warning,) = [record.getMessage() for record in caplog.records]
    assert warning.startswith(f"P/S/odd: differs from the earlier result ({first['odd'].digest})")
