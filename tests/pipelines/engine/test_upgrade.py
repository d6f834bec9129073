"""Results of an earlier version of the code can be accepted, and are marked as such."""

from collections.abc import Callable
from typing import Any

import pytest

from pipelines.engine.actions.step import Output, Step, Success, Value
from pipelines.engine.audit import repeat, verify
from pipelines.engine.plan import State, make_plan
from pipelines.engine.store.store import Acceptance, Store
from pipelines.engine.trace import read_actions, trace
from pipelines.engine.upgrade import accept, stale_actions, versions

Chain = Callable[..., list[Step]]

FIRST = "def run(inputs, parameters, places):\n    return inputs['film'].upper()\n"
SECOND = "def run(inputs, parameters, places):\n    return inputs['first'] + b'!'\n"
SAME_FIRST = "def run(inputs, parameters, places):\n    film = inputs['film']\n    return film.upper()\n"
OTHER_FIRST = "def run(inputs, parameters, places):\n    return inputs['film'].lower()\n"


@pytest.fixture
def chain(package: Any) -> Chain:
    """first(film) -> second(first)."""

    def draw(first: str = FIRST, second: str = SECOND, film: bytes = b"Film") -> list[Step]:
        first_module, second_module = package.step_module("first", first), package.step_module("second", second)
        return [
            Step("P/S", "first", first_module, None, {"film": Value(film)}),
            Step("P/S", "second", second_module, None, {"first": Output("P/S/first")}),
        ]

    return draw


def acceptance(old: str) -> Acceptance:
    return Acceptance(old, ["code of first changed"], 1, 1, "2026-11-23T10:00:00+00:00", "one line more")


def test_steps_whose_code_alone_is_new_are_stale_and_what_follows_is_known(
    chain: Chain, store: Store, run_steps: Any
) -> None:
    run_steps(*chain())
    assert stale_actions(chain(), store) == {}
    steps = chain(SAME_FIRST)
    [stale] = stale_actions(steps, store).values()  # the input of the second step is unchanged: it is a hit
    assert (stale.action.step.kind, versions(stale, store)) == ("first", [f"code of {steps[0].module} changed"])
    assert repeat(stale.action, store) is None


def test_another_input_or_a_step_that_never_ran_is_not_stale(chain: Chain, store: Store, run_steps: Any) -> None:
    run_steps(chain()[0])
    assert stale_actions(chain(SAME_FIRST, film=b"another"), store) == {}
    assert [stale.action.step.kind for stale in stale_actions(chain(SAME_FIRST), store).values()] == ["first"]


def test_what_is_accepted_is_a_hit_and_trace_tells(chain: Chain, store: Store, run_steps: Any) -> None:
    outcomes, _ = run_steps(*chain())
    steps = chain(SAME_FIRST)
    [stale] = stale_actions(steps, store).values()
    accept(stale, acceptance(stale.upgrade.old), store)
    plan = make_plan(steps, store)
    assert [planned.state for planned in plan.steps] == [State.HIT, State.HIT]
    assert verify(store).damaged == []
    result = outcomes["second"]
    assert isinstance(result, Success)
    origin = trace(result.digest, read_actions(store), store, "P/S")
    assert origin is not None
    by_step = {action.step: action.accepted for action in origin.actions.values()}
    assert by_step == {"P/S/first": acceptance(stale.upgrade.old), "P/S/second": None}
    run_steps(*chain())
    assert stale_actions(chain(), store) == {}  # the old rows are unchanged


def test_what_follows_from_a_refused_step_is_not_known(chain: Chain, store: Store, run_steps: Any) -> None:
    run_steps(*chain())
    steps = chain(OTHER_FIRST, SECOND.replace("b'!'", "b'!' + b''"))
    first, second = stale_actions(steps, store).values()
    assert repeat(second.action, store) is None
    difference = repeat(first.action, store)
    assert difference is not None
    assert difference.result == b"film"
    assert stale_actions(steps, store, [first.upgrade]) == {}


def test_a_result_that_is_lost_is_not_stale(chain: Chain, store: Store, run_steps: Any) -> None:
    outcomes, _ = run_steps(*chain())
    store.files.remove(f"blobs/{outcomes['first'].digest[:2]}/{outcomes['first'].digest}")
    assert stale_actions(chain(SAME_FIRST), store) == {}
