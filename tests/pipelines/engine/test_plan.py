"""A plan lists the steps that would run, with the reasons."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipelines.engine.actions.step import Failure, Output, Step, Success, Value
from pipelines.engine.files.names import blob_name
from pipelines.engine.plan import State, make_plan, with_places, without_places
from pipelines.engine.store.store import Store
from schemas.base.model import Document

RunSteps = Callable[..., Any]


class Factor(Document):
    factor: int = 2
    shift: int = 0


@pytest.fixture
def chain(package: Any) -> Callable[..., list[Step]]:
    """first(film) -> second(first, remark) -> third(second), each with a module of its own."""
    modules = [package.step_module(kind) for kind in ("first", "second", "third")]

    def draw(film: bytes = b"film", remark: bytes = b"", factor: int = 2, writes: Path | None = None) -> list[Step]:
        return [
            Step("P/S", "first", modules[0], None, {"film": Value(film)}, 3, writes=writes),
            Step(
                "P/S", "second", modules[1], Factor(factor=factor),
                {"first": Output("P/S/first-3"), "remark": Value(remark)},
            ),
            Step("P/S", "third", modules[2], None, {"second": Output("P/S/second")}),
        ]  # fmt: skip

    return draw


def states_of(steps: list[Step], store: Store) -> list[tuple[str, str]]:
    return [(planned.state.value, planned.reason) for planned in make_plan(steps, store).steps]


HITS = [("hit", "")] * 3


def test_nothing_has_run(chain: Any, store: Store) -> None:
    plan = make_plan(chain(), store)
    assert states_of(chain(), store) == [
        ("miss", "never run"), ("waits", "waits for first of camera 3"), ("waits", "waits for second"),
    ]  # fmt: skip
    assert plan.to_run == plan.steps
    assert [planned.step.name for planned in plan.steps] == ["P/S/first-3", "P/S/second", "P/S/third"]


def test_all_has_run(chain: Any, store: Store, run_steps: RunSteps) -> None:
    run_steps(*chain())
    plan = make_plan(chain(), store)
    assert states_of(chain(), store) == HITS
    assert plan.to_run == []
    outcome = plan.steps[2].outcome
    assert isinstance(outcome, Success)
    assert store.get(outcome.digest) == b"film+*2"


def test_reasons(chain: Any, store: Store, run_steps: RunSteps) -> None:
    run_steps(*chain())
    behind = ("waits", "waits for second")
    assert states_of(chain(film=b"other"), store)[0] == ("miss", "input film changed")
    assert states_of(chain(remark=b"other"), store) == [HITS[0], ("miss", "input remark changed"), behind]
    assert states_of(chain(factor=3), store) == [HITS[0], ("miss", "parameter factor changed"), behind]
    both = states_of(chain(factor=3, remark=b"other"), store)[1]
    assert both == ("miss", "input remark changed, parameter factor changed")


def test_reason_of_changed_code(chain: Any, store: Store, run_steps: RunSteps, package: Any) -> None:
    run_steps(*chain())
    source = (package.folder / "second.py").read_text()
    package.write("second", source + "\n# a remark\n")
    steps = chain()
    package.forget()
    assert states_of(steps, store) == HITS
    package.write("second", source + "\nX = 1\n")
    package.forget()
    assert states_of(steps, store)[1] == ("miss", f"code of {package.name}.second changed")


def test_reason_of_a_result_that_is_gone(chain: Any, store: Store, run_steps: RunSteps, tmp_path: Path) -> None:
    written = tmp_path / "frames/cam3/zarr.json"
    written.parent.mkdir(parents=True)
    written.touch()
    outcomes, _ = run_steps(*chain(writes=written))
    assert states_of(chain(writes=written), store) == HITS
    written.unlink()
    assert states_of(chain(writes=written), store)[0] == ("miss", "cam3 is not there")
    store.files.remove(blob_name(outcomes["second"].digest))
    assert states_of(chain(), store) == [HITS[0], ("miss", "its result is gone"), ("waits", "waits for second")]


def test_a_first_plan_says_never_run_whatever_the_step_would_write(
    chain: Any, store: Store, run_steps: RunSteps, tmp_path: Path
) -> None:
    written = tmp_path / "frames/cam3/zarr.json"
    assert states_of(chain(writes=written), store)[0] == ("miss", "never run")
    written.parent.mkdir(parents=True)
    written.touch()
    run_steps(*chain(writes=written))
    written.unlink()
    assert states_of(chain(writes=written, film=b"other"), store)[0] == ("miss", "cam3 is not there")


def test_going_back_to_an_earlier_parameter_is_a_hit(chain: Any, store: Store, run_steps: RunSteps) -> None:
    run_steps(*chain(factor=2))
    run_steps(*chain(factor=3))
    assert states_of(chain(factor=2), store) == states_of(chain(factor=3), store) == HITS


def test_planning_writes_nothing(chain: Any, store: Store) -> None:
    make_plan(chain(), store)
    assert not Path(store.files.path("")).exists()


def test_cached_failure_is_a_hit_for_all_that_stand_behind_it(
    chain: Any, store: Store, run_steps: RunSteps, package: Any
) -> None:
    source = "from schemas.base.errors import Finding\ndef run(*_):\n    raise Finding('no stripe')\n"
    steps = chain()
    steps[0] = steps[0]._replace(module=package.step_module("bad", source))
    run_steps(*steps)
    plan = make_plan(steps, store)
    assert [planned.state for planned in plan.steps] == [State.HIT] * 3
    assert {planned.outcome for planned in plan.steps} == {Failure("no stripe", "finding", "P/S/first-3")}


def test_places_leave_and_return() -> None:
    here = {"film": Path("/a/P1/cam 1.avi"), "array": Path("/a/P1/frames.zarr/cam1")}
    there = {"film": Path("/b/cam2.avi"), "array": Path("/b/frames.zarr/cam2")}
    problem = "/a/P1/cam 1.avi: truncated (see /a/P1/frames.zarr/cam1)"
    kept = without_places(problem, here)
    assert "/a/" not in kept
    assert with_places(kept, here) == problem
    assert with_places(kept, there) == "/b/cam2.avi: truncated (see /b/frames.zarr/cam2)"
    assert with_places(without_places("no stripe", here), there) == "no stripe"
