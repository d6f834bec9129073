"""What would run, and why: a pure function of the graph and the action cache."""

import gc
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import NamedTuple

from pipelines.engine.actions.key import image_text, key_of
from pipelines.engine.actions.step import Failure, Outcome, Output, Step, Success
from pipelines.engine.explain import changes, reason
from pipelines.engine.store.store import Store
from pipelines.engine.store.verified_index import Known

NO_SEAL = "its row bears no seal of the store's owner"


class State(Enum):
    """What the cache knows of a step."""

    HIT = "hit"
    MISS = "miss"
    WAITS = "waits"
    """An input is still to be made: whether the step runs depends on what comes out."""


class PlannedStep(NamedTuple):
    """A step, and what is to be done with it."""

    step: Step
    state: State
    outcome: Outcome | None
    """What the cache holds, for a hit."""
    reason: str
    """Why the step is no hit."""


@dataclass(frozen=True)
class Plan:
    """The steps of a graph in an order in which they can run."""

    steps: list[PlannedStep]

    @property
    def to_run(self) -> list[PlannedStep]:
        """All that is no hit."""
        return [planned for planned in self.steps if planned.state is not State.HIT]


def make_plan(steps: Sequence[Step], store: Store) -> Plan:
    """Look each step up in the action cache.

    Parameters
    ----------
    steps : sequence of Step
        Each after the steps whose results it takes.
    """
    planned: dict[str, PlannedStep] = {}
    with _all_kept(), nullcontext() if store.verified is None else store.verified.reading():
        for step in steps:
            planned[step.name] = _plan_step(step, planned, store)
    return Plan(list(planned.values()))


@contextmanager
def _all_kept() -> Iterator[None]:
    """Without Python's search for circles, a sixth of the time of a large plan, of which nothing is thrown away."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def cached_outcome(step: Step, known: Known | None) -> Outcome | None:
    """What the action cache says of a step; None where the step must run."""
    if known is None:
        return None
    if known.digest is None:
        return Failure(with_places(known.problem or "", step.places), known.kind or "", step.name)
    is_there = step.writes is None or step.writes.exists()
    return Success(known.digest) if is_there else None


def without_places(problem: str, places: Mapping[str, Path]) -> str:
    """`problem` with names in the stead of paths: an equal film elsewhere fails alike, but is another file."""
    for name, path in places.items():
        problem = problem.replace(str(path), f"\0{name}\0")
    return problem


def with_places(problem: str, places: Mapping[str, Path]) -> str:
    """The opposite of `without_places`."""
    for name, path in places.items():
        problem = problem.replace(f"\0{name}\0", str(path))
    return problem


def _plan_step(step: Step, planned: dict[str, PlannedStep], store: Store) -> PlannedStep:
    digests: dict[str, str] = {}
    for name, source in step.inputs.items():
        if not isinstance(source, Output):
            digests[name] = source.digest
            continue
        before = planned[source.step]
        if isinstance(before.outcome, Failure):
            return PlannedStep(step, State.HIT, before.outcome, "")
        if before.outcome is None:
            return PlannedStep(step, State.WAITS, None, f"waits for {_label(before.step)}")
        digests[name] = before.outcome.digest
    image = image_text(step, digests)
    outcome = cached_outcome(step, store.lookup(key_of(image)))
    if outcome is not None:
        return PlannedStep(step, State.HIT, outcome, "")
    return PlannedStep(step, State.MISS, None, _reason(step, image, store))


def _reason(step: Step, image: str, store: Store) -> str:
    latest = store.latest(step.name)
    if latest is None:
        return "never run"
    if step.writes is not None and not step.writes.exists():
        return f"{step.writes.parent.name} is not there"
    if store.bears_no_seal(key_of(image)):
        return NO_SEAL
    row = store.row(latest.key)
    return "never run" if row is None else reason(changes(step, row.image, json.loads(image), store))


def _label(step: Step) -> str:
    return step.kind if step.camera is None else f"{step.kind} of camera {step.camera}"
