"""Running a plan: only steps that are not hits become Dask tasks."""

import contextlib
import importlib
import json
import logging
import os
import platform
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from weakref import WeakValueDictionary

from pipelines.engine.actions.code import CodeIdentity, code_identity, code_text
from pipelines.engine.actions.key import image_text, key_of
from pipelines.engine.actions.step import Failure, Input, Outcome, Output, SourceFile, Step, Success, Value
from pipelines.engine.files.digest import file_state
from pipelines.engine.files.packs import PackedFiles
from pipelines.engine.plan import FORCED, Plan, cached_outcome, without_places
from pipelines.engine.pool import OnStepEnd, Pool, StepEnd, Task
from pipelines.engine.store.store import Acceptance, Row, Store
from schemas.base.errors import DamagedError, Fault, Finding, RefusedInput, one_line
from schemas.base.limits import BeyondLimitError

log = logging.getLogger("footscan.run")


def run_plan(plan: Plan, store: Store, *, pool: Pool, on_step_end: OnStepEnd) -> dict[str, Outcome]:
    """Run the steps of a plan that are not hits.

    Returns
    -------
    outcomes : dict
        Result or failure of every step by its name, hits included.
    """
    outcomes = {planned.step.name: planned.outcome for planned in plan.steps if planned.outcome is not None}

    def on_end(end: StepEnd) -> None:
        if end.earlier_outcome is not None:
            log.warning(
                "%s: differs from the earlier result (%s) of the same inputs, parameters and code: "
                "the step is not deterministic, see 'footscan cache verify --recompute'",
                end.step.name, end.earlier_outcome,
            )  # fmt: skip
        on_step_end(end)

    tasks: dict[str, Task] = {}
    for planned in plan.to_run:
        producers = [source.step for source in planned.step.inputs.values() if isinstance(source, Output)]
        outcomes_before = {name: outcomes[name] for name in producers if name not in tasks}
        code = code_identity(planned.step.module).digest
        waits_for = tuple(name for name in producers if name in tasks)
        is_forced = planned.reason == FORCED
        tasks[planned.step.name] = Task(planned.step, code, outcomes_before, waits_for, is_forced)
    return outcomes | pool.run(tasks, partial(run_step, store), on_end) if tasks else outcomes


def run_step(store: Store, task: Task, ended: Mapping[str, StepEnd]) -> StepEnd:
    """Run one step, unless the cache has a result for its inputs, or one of them has failed."""
    started, worker = time.time(), f"{platform.node()} {os.getpid()} {threading.get_native_id()}"
    return replace(_run_task(store, task, ended), started=started, worker=worker)


def _run_task(store: Store, task: Task, ended: Mapping[str, StepEnd]) -> StepEnd:
    start = time.perf_counter()
    step = task.step
    if code_identity(step.module).digest != task.code:
        problem = f"{step.name}: {platform.node()} has another version of footscan, expected the one that planned it"
        return StepEnd(step, Failure(problem, "fault", step.name), False, time.perf_counter() - start)
    results = {**task.before, **{name: end.outcome for name, end in ended.items()}}
    digests: dict[str, str] = {}
    for name, source in step.inputs.items():
        if not isinstance(source, Output):
            digests[name] = source.digest
            continue
        result = results[source.step]
        if isinstance(result, Failure):
            return StepEnd(step, result, False, time.perf_counter() - start)
        digests[name] = result.digest
    return execute(step, digests, store, is_forced=task.is_forced)


def execute(step: Step, inputs: Mapping[str, str], store: Store, *, is_forced: bool = False) -> StepEnd:
    """The outcome of a step with inputs of these digests, from the cache unless `is_forced`, or by running the step."""
    start = time.perf_counter()
    image = image_text(step, inputs)
    key = key_of(image)
    with _exclusive(key):
        try:
            outcome = None if is_forced else cached_outcome(step, store.lookup(key))
        except Fault as error:  # the store is unreachable: this scan fails; the next plan reports a lasting failure
            return StepEnd(step, Failure(str(error), "fault", step.name), False, time.perf_counter() - start)
        ran, earlier, size = outcome is None, None, 0
        if outcome is None:
            outcome, earlier, size = _run_safely(step, image, inputs, store)
        else:
            _note_latest(step, key, store)
    return StepEnd(step, outcome, ran, time.perf_counter() - start, earlier, size=size)


@contextmanager
def _exclusive(key: str) -> Iterator[None]:
    """Let threads with the same action (scans with equal films) take turns: all use the first result."""
    with _REGISTRY_LOCK:
        action_lock = _ACTION_LOCKS.setdefault(key, threading.Lock())
    with action_lock:
        yield


_REGISTRY_LOCK = threading.Lock()
_ACTION_LOCKS: WeakValueDictionary[str, threading.Lock] = WeakValueDictionary()
"""Lock of each action by its key; a lock exists as long as a thread holds it or waits for it."""


def _run_safely(step: Step, image: str, inputs: Mapping[str, str], store: Store) -> tuple[Outcome, str | None, int]:
    """Run a step as `_run` does, and return an error as a failure."""
    try:
        return _run(step, image, inputs, store)
    except Fault as error:
        return Failure(str(error), "damaged" if isinstance(error, DamagedError) else "fault", step.name), None, 0
    except Exception as error:  # a defect in our code or in a library must not stop the other scans
        log.debug("%s", step.name, exc_info=True)
        problem = one_line(f"{step.name}: {type(error).__name__}: {error}")
        is_defect = not isinstance(error, OSError | MemoryError)
        return Failure(problem, "fault", step.name, is_defect), None, 0


def _run(step: Step, image: str, inputs: Mapping[str, str], store: Store) -> tuple[Outcome, str | None, int]:
    """Run a step and record its outcome, unless its files changed meanwhile.

    Also returns a differing earlier outcome, and the size of the result in bytes.
    """
    contents = {name: content_of(step, source, inputs[name], store) for name, source in step.inputs.items()}
    try:
        result = importlib.import_module(step.module).run(contents, step.parameters, step.places)
    except (RefusedInput, Finding) as error:
        _check_sources(step)
        kind, problem = "finding" if isinstance(error, Finding) else "refused", str(error)
        if isinstance(error, BeyondLimitError):  # not cached: the limit is no input of the step
            return Failure(problem, kind, step.name), None, 0
        failure = kind, without_places(problem, step.places)
        return Failure(problem, kind, step.name), record_outcome(step, image, (None, failure), store), 0
    _check_sources(step)
    digest = store.put(result)
    return Success(digest), record_outcome(step, image, (digest, None), store), len(result)


def record_outcome(
    step: Step,
    image: str,
    outcome: tuple[str | None, tuple[str, str] | None],
    store: Store,
    accepted: Acceptance | None = None,
) -> str | None:
    """Write an action's row, after the blobs that it names: its code and its input values.

    Parameters
    ----------
    step : Step
    image : pre-image of the action's key, as `image_text` gives it
    outcome : (digest, failure)
        As in `Row`; one of the two is None.
    store : Store
    accepted : Acceptance, optional
        For an outcome of an earlier version of the code.

    Returns
    -------
    before : str or None
        The outcome in an earlier row of the same action, if it differs: of a concurrent run, or of a run whose result
        was lost.
    """
    _keep_code(code_identity(step.module), store)
    for source in step.inputs.values():
        if isinstance(source, Value):
            store.put(source.content)
    row, before = Row(json.loads(image), *outcome, accepted), store.row(key_of(image))
    store.record(step.name, row, _sources(step))
    is_same = before is None or (before.digest, before.failure) == outcome
    return None if before is None or is_same else before.digest or str(before.failure)


def _note_latest(step: Step, key: str, store: Store) -> None:
    """Record a cached result of another step or an earlier run as the last result of this step."""
    with contextlib.suppress(Fault):  # the result is in the store in any case
        latest = store.latest(step.name)
        if latest is None or latest.key != key:
            store.note_latest(step.name, key, _sources(step))


def _sources(step: Step) -> dict[str, str]:
    """Paths of the files that a step's inputs are or were read from, by the name of the input."""
    paths = {name: source.path for name, source in step.inputs.items() if not isinstance(source, Output)}
    return {name: str(path) for name, path in paths.items() if path is not None}


def _keep_code(identity: CodeIdentity, store: Store) -> None:
    """Store the texts of a step's code if they are missing or damaged; each is checked once in a process."""
    if (store.files, identity.digest) in _STORED_CODE and store.has(identity.digest):
        return
    for module, digest in identity.modules.items():
        if (store.files, digest) in _STORED_CODE and store.has(digest):
            continue
        if store.get(digest) is None:
            store.put(code_text(module))
        _STORED_CODE.add((store.files, digest))
    store.put(identity.document)
    _STORED_CODE.add((store.files, identity.digest))


_STORED_CODE: set[tuple[PackedFiles, str]] = set()


def content_of(step: Step, source: Input, digest: str, store: Store) -> bytes:
    """The bytes of an input as the step receives them; DamagedError if the result of another step is damaged."""
    if isinstance(source, Value):
        return source.content
    if isinstance(source, SourceFile):
        return b""  # the step reads the file itself
    data = store.get(digest)
    if data is None:
        raise DamagedError(f"{step.name}: the result of {source.step} is damaged, expected what was stored")
    return data


def _check_sources(step: Step) -> None:
    """Raise Fault if a source file changed while the step read it: the outcome then belongs to no digest."""
    for source in step.inputs.values():
        if isinstance(source, SourceFile):
            for path, state in source.states:
                try:
                    unchanged = file_state(path) == state
                except OSError:
                    unchanged = False
                if not unchanged:
                    raise Fault(f"{path}: changed while it was read, expected a finished file")
