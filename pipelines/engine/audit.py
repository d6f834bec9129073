"""Whether a store is what it says: everything in it read, and actions done again."""

import importlib
import logging
import random
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path

from pipelines.engine.actions.key import image_text, key_of
from pipelines.engine.actions.step import Failure, Outcome, Output, Step, Success
from pipelines.engine.files.digest import sha256
from pipelines.engine.files.seal import BROKEN, sealed, unsealed
from pipelines.engine.files.secret import make_secret
from pipelines.engine.plan import Plan, without_places
from pipelines.engine.run import content_of
from pipelines.engine.store.lease import FOLDER as LEASES
from pipelines.engine.store.lease import leases
from pipelines.engine.store.pins import FOLDER as PINS
from pipelines.engine.store.pins import read_pin
from pipelines.engine.store.store import Store, latest_name
from pipelines.engine.trace import blob_digest, row_key
from schemas.base.errors import DamagedError, Finding, RefusedInput

log = logging.getLogger("footscan.store")


@dataclass(frozen=True)
class Audit:
    """What was read."""

    files: int
    damaged: list[str]
    """How a person would name them; they are there no more."""


@dataclass(frozen=True)
class Sealing:
    """What became of the rows and last actions of a store that were not sealed."""

    sealed: int
    unsealed: int
    """Left as they were: they count as missing."""


@dataclass(frozen=True)
class Repeatable:
    """An action of the present plan whose inputs are all there."""

    step: Step
    inputs: Mapping[str, str]
    """Digests by name."""
    outcome: Outcome
    """As it is recorded."""


@dataclass(frozen=True)
class Difference:
    """An action that did not come to the same again."""

    step: str
    recorded: str
    """Digest of the result, or the failure."""
    found: str
    result: bytes | None = field(default=None, repr=False, compare=False)
    """What came out this time; None for a failure."""


def verify(store: Store) -> Audit:
    """Read all blobs, rows, last actions, pins and leases, and say, a line each, what is damaged.

    It is removed, and will be made again; only a pin stays, for what it keeps must not go unnoticed.
    """
    files = 0
    damaged = []
    for folder in (*CHECKS, PINS):
        for name in [name for name, _ in store.files.sizes(folder)]:
            files += 1
            if folder == PINS:
                is_damaged = name.endswith(".json") and _is_damaged_pin(name, store)
            elif is_damaged := CHECKS[folder](name, store):
                store.files.remove(name)
            if is_damaged:
                damaged.append(store.files.path(name))
    return Audit(files, damaged)


def seal_store(store: Store, *, every: bool = False) -> Sealing:
    """Seal the sound rows and last actions of a store: all where it was not sealed before, or where `every` says so."""
    secret = store.secret
    if secret is None:
        secret, every = make_secret(store.files), True
    done = left = 0
    for name in [name for folder in ("actions", "latest") for name, _ in store.files.sizes(folder)]:
        data = _read(name, store)
        if data is None or not _is_sealed(data) or _is_sealed(data, secret):
            continue
        if every:
            store.files.write(name, sealed(unsealed(data), secret))
        done, left = done + every, left + (not every)
    return Sealing(done, left)


def repeatable(plan: Plan, store: Store) -> dict[str, Repeatable]:
    """What of a plan is known and could be done again, by key: the code is the present one, all inputs are there."""
    outcomes = {planned.step.name: planned.outcome for planned in plan.steps}
    found = {}
    for planned in plan.steps:
        outcome = planned.outcome
        if outcome is None or (isinstance(outcome, Failure) and outcome.cause != planned.step.name):
            continue  # not known, or known only to fail with another
        digests = input_digests(planned.step, outcomes)
        results = [digests.get(name) for name, source in planned.step.inputs.items() if isinstance(source, Output)]
        if all(digest is not None and store.has(digest) for digest in results):
            found[key_of(image_text(planned.step, digests))] = Repeatable(planned.step, digests, outcome)
    return found


def sample(keys: Iterable[str], share: float, seed: int) -> set[str]:
    """A share (0 to 1) of these, drawn at random, but at least one if there is any."""
    every = sorted(set(keys))
    return set(random.Random(seed).sample(every, ceil(share * len(every))))


def repeat(action: Repeatable, store: Store) -> Difference | None:
    """Do an action again without the cache, and hold what comes out against what is recorded.

    What the step leaves behind beside its result goes to a folder that is thrown away.

    Raises
    ------
    Fault
        It could not be done: a file of the machine, or a result in the store, is damaged.
    """
    with tempfile.TemporaryDirectory(prefix="footscan-") as folder:
        step = _elsewhere(action.step, Path(folder))
        inputs = {name: content_of(step, source, action.inputs[name], store) for name, source in step.inputs.items()}
        try:
            result = importlib.import_module(step.module).run(inputs, step.parameters, step.places)
            found = sha256(result)
        except (RefusedInput, Finding) as error:
            result, found = None, without_places(str(error), step.places)
    recorded = action.outcome
    known = recorded.digest if isinstance(recorded, Success) else without_places(recorded.problem, action.step.places)
    return None if found == known else Difference(step.name, known, found, result)


def input_digests(step: Step, outcomes: Mapping[str, Outcome | None]) -> dict[str, str]:
    """Digests of a step's inputs, as far as the outcomes of the steps before are known."""
    digests = {}
    for name, source in step.inputs.items():
        if not isinstance(source, Output):
            digests[name] = source.digest
        elif isinstance(before := outcomes.get(source.step), Success):
            digests[name] = before.digest
    return digests


def _is_damaged_blob(name: str, store: Store) -> bool:
    digest = blob_digest(name)
    data = None if digest is None else _read(name, store)
    return data is not None and sha256(data) != digest and _said(name, store)


def _is_damaged_row(name: str, store: Store) -> bool:
    key = row_key(name)
    data = None if key is None else _read(name, store)
    if key is None or data is None:
        return False
    if not _is_sealed(data):
        return _said(name, store)
    return store.row(key) is None and store.files.state(name) is not None  # the store itself has said it


def _is_damaged_latest(name: str, store: Store) -> bool:
    data = _read(name, store) if name.endswith(".json") else None
    if data is None:
        return False
    latest = store.read_latest(name) if _is_sealed(data) else None
    return (latest is None or latest_name(latest.step) != name) and _said(name, store)


def _is_damaged_lease(name: str, store: Store) -> bool:
    return any(one.name == name and one.host is None for one in leases(store)) and _said(name, store)


def _is_damaged_pin(name: str, store: Store) -> bool:
    try:
        read_pin(name, store)
    except DamagedError as error:
        log.warning("%s", error)
        return True
    return False


CHECKS: dict[str, Callable[[str, Store], bool]] = {
    "blobs": _is_damaged_blob,
    "actions": _is_damaged_row,
    "latest": _is_damaged_latest,
    LEASES: _is_damaged_lease,
}
"""Of each folder, what tells whether a file of it is damaged; files that are none of the store's are let be."""


def _read(name: str, store: Store) -> bytes | None:
    """A file's content; None where it has gone meanwhile, and nothing of use where it cannot be read."""
    try:
        return store.files.read(name)
    except FileNotFoundError:
        return None
    except OSError:
        return b""


def _is_sealed(data: bytes, secret: bytes | None = None) -> bool:
    try:
        unsealed(data, secret)
    except BROKEN:
        return False
    return True


def _said(name: str, store: Store) -> bool:
    log.warning("%s: damaged, will be made again", store.files.path(name))
    return True


def _elsewhere(step: Step, folder: Path) -> Step:
    """The same step, leaving what it writes in `folder`."""
    writes = step.writes
    if writes is None:
        return step
    places = {name: folder / name if writes.is_relative_to(place) else place for name, place in step.places.items()}
    return step._replace(places=places)
