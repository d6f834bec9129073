"""Audits of a store: read every file and check it, seal rows, and run actions again."""

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
from pipelines.engine.files.names import blob_digest, latest_name, row_key
from pipelines.engine.files.seal import UNSEALING_ERRORS, sealed, unsealed
from pipelines.engine.files.secret import make_secret
from pipelines.engine.plan import Plan, without_places
from pipelines.engine.progress import OnProgress, unheard
from pipelines.engine.run import content_of
from pipelines.engine.store.lease import FOLDER as LEASES
from pipelines.engine.store.lease import leases
from pipelines.engine.store.pins import FOLDER as PINS
from pipelines.engine.store.pins import read_pin
from pipelines.engine.store.store import Store
from schemas.base.errors import DamagedError, Finding, RefusedInput

log = logging.getLogger("footscan.store")


@dataclass(frozen=True)
class Audit:
    """Result of reading all files of a store."""

    files: int
    damaged: list[str]
    """Paths or URLs of the damaged files. All but pins have been removed."""


@dataclass(frozen=True)
class Sealing:
    """Counts of the rows and last actions without a seal."""

    sealed: int
    unsealed: int
    """Left unsealed: they count as missing."""


@dataclass(frozen=True)
class Repeatable:
    """An action of the present plan whose inputs are all in the store."""

    step: Step
    inputs: Mapping[str, str]
    """Digests by name."""
    outcome: Outcome
    """Recorded outcome."""


@dataclass(frozen=True)
class Difference:
    """An action whose repetition differs from the recorded outcome."""

    step: str
    recorded: str
    """Digest of the recorded result, or the problem of the recorded failure."""
    found: str
    """The same of the repetition."""
    result: bytes | None = field(default=None, repr=False, compare=False)
    """Result of the repetition; None for a failure."""


def verify(store: Store, on_progress: OnProgress = unheard) -> Audit:
    """Read all blobs, rows, last actions, pins and leases, and log a warning for each damaged file.

    `on_progress` is called with the files that were read and their number.

    Damaged files are removed and will be made again. A damaged pin stays: the user must learn what is no longer kept.
    """
    packs = store.files.damaged_packs()  # they have been logged
    damaged = [store.files.path(name) for name in packs]
    files = len(damaged)
    store.files.remove_all(packs)
    names = {folder: [name for name, _ in store.files.sizes(folder)] for folder in (*CHECKS, PINS)}
    total = files + sum(map(len, names.values()))
    for folder, in_folder in names.items():
        for name in in_folder:
            files += 1
            on_progress(files, total)
            if folder == PINS:
                is_damaged = name.endswith(".json") and _is_damaged_pin(name, store)
            elif is_damaged := CHECKS[folder](name, store):
                store.files.remove(name)
            if is_damaged:
                damaged.append(store.files.path(name))
    return Audit(files, damaged)


def seal_store(store: Store, *, every: bool = False) -> Sealing:
    """Seal the sound rows, last actions and pins of a store: all if the store had no secret yet or `every` is set."""
    secret = store.secret
    if secret is None:
        secret, every = make_secret(store.files.place), True
    sealed_count = unsealed_count = 0
    for name in [name for folder in ("actions", "latest", PINS) for name, _ in store.files.sizes(folder)]:
        data = _read(name, store)
        if data is None or not _is_sealed(data) or _is_sealed(data, secret):
            continue
        if every:
            store.files.write(name, sealed(unsealed(data), secret))
        sealed_count += every
        unsealed_count += not every
    return Sealing(sealed_count, unsealed_count)


def repeatable(plan: Plan, store: Store) -> dict[str, Repeatable]:
    """The actions of a plan that can be repeated, by key: their outcome is cached and all inputs are in the store."""
    outcomes = {planned.step.name: planned.outcome for planned in plan.steps}
    actions = {}
    for planned in plan.steps:
        outcome = planned.outcome
        if outcome is None or (isinstance(outcome, Failure) and outcome.cause != planned.step.name):
            continue  # not cached, or it fails only because another step failed
        digests = input_digests(planned.step, outcomes)
        results = [digests.get(name) for name, source in planned.step.inputs.items() if isinstance(source, Output)]
        if all(digest is not None and store.has(digest) for digest in results):
            actions[key_of(image_text(planned.step, digests))] = Repeatable(planned.step, digests, outcome)
    return actions


def sample(keys: Iterable[str], share: float, seed: int) -> set[str]:
    """A random sample with a share (0 to 1) of `keys`, rounded up."""
    unique_keys = sorted(set(keys))
    return set(random.Random(seed).sample(unique_keys, ceil(share * len(unique_keys))))


def repeat(action: Repeatable, store: Store) -> Difference | None:
    """Run an action again without the cache, and compare the outcome with the recorded one.

    Files that the step writes outside the store go to a temporary folder.

    Raises
    ------
    Fault
        The step could not be run to its end, or a result in the store is damaged.
    """
    with tempfile.TemporaryDirectory(prefix="footscan-") as folder:
        step = _redirected(action.step, Path(folder))
        inputs = {name: content_of(step, source, action.inputs[name], store) for name, source in step.inputs.items()}
        try:
            result = importlib.import_module(step.module).run(inputs, step.parameters, step.places)
            repeated = sha256(result)
        except (RefusedInput, Finding) as error:
            result, repeated = None, without_places(str(error), step.places)
    step, outcome = action.step, action.outcome
    recorded = outcome.digest if isinstance(outcome, Success) else without_places(outcome.problem, step.places)
    return None if repeated == recorded else Difference(step.name, recorded, repeated, result)


def input_digests(step: Step, outcomes: Mapping[str, Outcome | None]) -> dict[str, str]:
    """Digests of those inputs of a step that are known; `outcomes` are those of the earlier steps."""
    digests = {}
    for name, source in step.inputs.items():
        if not isinstance(source, Output):
            digests[name] = source.digest
        elif isinstance(outcome := outcomes.get(source.step), Success):
            digests[name] = outcome.digest
    return digests


def _is_damaged_blob(name: str, store: Store) -> bool:
    digest = blob_digest(name)
    data = None if digest is None else _read(name, store)
    return data is not None and sha256(data) != digest and _logged_as_damaged(name, store)


def _is_damaged_row(name: str, store: Store) -> bool:
    key = row_key(name)
    data = None if key is None else _read(name, store)
    if key is None or data is None:
        return False
    if not _is_sealed(data):
        return _logged_as_damaged(name, store)
    return store.row(key) is None and store.files.state(name) is not None  # the store itself has logged it


def _is_damaged_latest(name: str, store: Store) -> bool:
    data = _read(name, store) if name.endswith(".json") else None
    if data is None:
        return False
    latest = store.read_latest(name) if _is_sealed(data) else None
    return (latest is None or latest_name(latest.step) != name) and _logged_as_damaged(name, store)


def _is_damaged_lease(name: str, store: Store) -> bool:
    return any(lease.name == name and lease.host is None for lease in leases(store)) and _logged_as_damaged(name, store)


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
"""Check of the files of each folder: True if a file is damaged. Files that are not the store's own pass."""


def _read(name: str, store: Store) -> bytes | None:
    """Content of a file; None if it was removed meanwhile, empty if it cannot be read."""
    try:
        return store.files.read(name)
    except FileNotFoundError:
        return None
    except OSError:
        return b""


def _is_sealed(data: bytes, secret: bytes | None = None) -> bool:
    try:
        unsealed(data, secret)
    except UNSEALING_ERRORS:
        return False
    return True


def _logged_as_damaged(name: str, store: Store) -> bool:
    log.warning("%s: damaged, will be made again", store.files.path(name))
    return True


def _redirected(step: Step, folder: Path) -> Step:
    """The same step, but writing its files into `folder`."""
    writes = step.writes
    if writes is None:
        return step
    places = {name: folder / name if writes.is_relative_to(place) else place for name, place in step.places.items()}
    return step._replace(places=places)
