"""The plan of a run: which steps would run, and why. A pure function of the graph and the action cache."""

import gc
import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import NamedTuple

from pipelines.engine.actions.key import image_text, key_of
from pipelines.engine.actions.step import Failure, Outcome, Output, Step, Success, is_named
from pipelines.engine.explain import changes, reason
from pipelines.engine.files.packs import PackedFiles, Snapshot
from pipelines.engine.store.store import Store
from pipelines.engine.store.verified_index import VerifiedRow

MANY = 1000
"""Steps from which the store is listed, rather than asked for each row and blob. Chosen by hand: a listing gives 1000
files at once."""
FORCED = "forced"
"""Reason of a step that runs because the user asked for it."""
NO_SEAL = "its row bears no seal of the store's owner"


class State(Enum):
    """State of a step in the action cache."""

    HIT = "hit"
    MISS = "miss"
    WAITS = "waits"
    """An input is not computed yet: whether the step runs depends on the digest of that result."""


class PlannedStep(NamedTuple):
    """A step, its state in the cache, and the reason why it is not a hit."""

    step: Step
    state: State
    outcome: Outcome | None
    """Cached outcome of a hit."""
    reason: str
    """Reason why the step is not a hit; empty for a hit."""


@dataclass(frozen=True)
class Plan:
    """The steps of a graph in an order in which they can run."""

    steps: list[PlannedStep]

    @property
    def to_run(self) -> list[PlannedStep]:
        """The steps that are not hits."""
        return [planned for planned in self.steps if planned.state is not State.HIT]


def make_plan(steps: Sequence[Step], store: Store, forced: Collection[str] = ()) -> Plan:
    """Look each step up in the action cache.

    Parameters
    ----------
    steps : sequence of Step
        In topological order: each step after the steps whose results it takes.
    forced : collection of str
        Steps that run even if the cache has their results, each as `is_named` takes it.
    """
    planned: dict[str, PlannedStep] = {}
    with _without_garbage_collection(), nullcontext() if store.verified is None else store.verified.reading():
        files = store.files.snapshot() if len(steps) >= MANY else store.files
        for step in steps:
            is_forced = bool(forced) and any(is_named(step, name) for name in forced)
            planned[step.name] = _plan_step(step, planned, store, files, is_forced=is_forced)
    return Plan(list(planned.values()))


@contextmanager
def _without_garbage_collection() -> Iterator[None]:
    """Switch the cyclic garbage collector off: it takes a sixth of the time of a large plan and frees nothing."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def cached_outcome(step: Step, row: VerifiedRow | None) -> Outcome | None:
    """The outcome of a step in the action cache; None if the step must run."""
    if row is None:
        return None
    if row.digest is None:
        return Failure(with_places(row.problem or "", step.places), row.kind or "", step.name)
    is_there = step.writes is None or step.writes.exists()
    return Success(row.digest) if is_there else None


def without_places(problem: str, places: Mapping[str, Path]) -> str:
    """`problem` with each path replaced by its name: an equal film in another folder then fails with the same text.

    Examples
    --------
    >>> without_places("/scans/cam1.avi: no frames", {"film": Path("/scans/cam1.avi")})
    '\\x00film\\x00: no frames'
    """
    for name, path in places.items():
        problem = problem.replace(str(path), f"\0{name}\0")
    return problem


def with_places(problem: str, places: Mapping[str, Path]) -> str:
    """The inverse of `without_places`."""
    for name, path in places.items():
        problem = problem.replace(f"\0{name}\0", str(path))
    return problem


def _plan_step(
    step: Step, planned: dict[str, PlannedStep], store: Store, files: PackedFiles | Snapshot, *, is_forced: bool
) -> PlannedStep:
    digests: dict[str, str] = {}
    for name, source in step.inputs.items():
        if not isinstance(source, Output):
            digests[name] = source.digest
            continue
        producer = planned[source.step]
        if isinstance(producer.outcome, Failure):
            return PlannedStep(step, State.HIT, producer.outcome, "")
        if producer.outcome is None:
            text = FORCED if is_forced else f"waits for {_label(producer.step)}"
            return PlannedStep(step, State.WAITS, None, text)
        digests[name] = producer.outcome.digest
    if is_forced:
        return PlannedStep(step, State.MISS, None, FORCED)
    image = image_text(step, digests)
    outcome = cached_outcome(step, store.lookup(key_of(image), files))
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
