"""Traces: all actions that a result came from, according to the rows of a store."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from pipelines.engine.explain import code_of, inputs_of, kind_of
from pipelines.engine.files.names import row_key
from pipelines.engine.store.store import Acceptance, Latest, Row, Store
from schemas.base.errors import RefusedInput
from schemas.base.json_files import parse_json


@dataclass(frozen=True)
class Actions:
    """All sound rows of a store and the last actions of its steps; damaged files are left out and were logged."""

    rows: dict[str, Row]
    """By key."""
    latest: list[Latest]

    @cached_property
    def makers(self) -> dict[str, list[str]]:
        """Keys of the actions with the same result, by its digest."""
        keys: dict[str, list[str]] = {}
        for key, row in self.rows.items():
            if row.digest is not None:
                keys.setdefault(row.digest, []).append(key)
        return keys

    @cached_property
    def steps(self) -> dict[str, list[Latest]]:
        """The steps with the same last action, by its key."""
        steps: dict[str, list[Latest]] = {}
        for latest in self.latest:
            steps.setdefault(latest.key, []).append(latest)
        return steps


@dataclass(frozen=True)
class TracedInput:
    """One input of an action."""

    name: str
    source: str
    """`value`, `file` or `result`."""
    digest: str
    place: str | None
    """Path of a file; None if it is not recorded."""
    content: bytes | None
    """Content of a value, if the store still has it."""
    made_by: str | None
    """Key of the action whose result the input is."""


@dataclass(frozen=True)
class TracedAction:
    """An action, as recorded in its row."""

    kind: str
    step: str | None
    """Name of the step; None if this is the last action of no step."""
    parameters: Any
    """Model and values; None for a step without parameters."""
    code: str | None
    libraries: dict[str, str]
    """Versions by name; empty if the store has lost the code."""
    result: str | None
    inputs: list[TracedInput] = field(default_factory=list)
    accepted: Acceptance | None = None
    """Set if the result is that of an earlier version of the code."""


@dataclass(frozen=True)
class Trace:
    """A result and all actions that it came from."""

    made_by: str
    actions: dict[str, TracedAction]
    """Actions by key; no action came from itself."""


def read_actions(store: Store) -> Actions:
    """Read all rows and last actions of a store."""
    rows = {}
    for name, _ in store.files.sizes("actions"):
        key = row_key(name)
        row = None if key is None else store.row(key)
        if key is not None and row is not None and isinstance(row.image, dict):  # a row made by hand may be anything
            rows[key] = row
    names = (name for name, _ in store.files.sizes("latest") if name.endswith(".json"))
    latest_actions = (store.read_latest(name) for name in names)
    return Actions(rows, [latest for latest in latest_actions if latest is not None])


def trace(digest: str, actions: Actions, store: Store, scan: str = "") -> Trace | None:
    """Trace of the result `digest`; None if no action has this result.

    Several actions may have the same result. The scan (`patient/scan`) and the camera then decide between them.
    """
    traced: dict[str, TracedAction] = {}
    key = _maker(digest, actions, scan, None, set())
    if key is None:
        return None
    _follow(key, actions, store, scan, set(), traced)
    return Trace(key, traced)


def _follow(
    key: str, actions: Actions, store: Store, scan: str, above: set[str], traced: dict[str, TracedAction]
) -> None:
    if key in traced:
        return
    row, last = actions.rows[key], _step_of(key, actions, scan)
    scan = scan or (last.step.rpartition("/")[0] if last else "")
    above = above | {key}
    inputs = []
    for name, (source, digest) in inputs_of(row.image).items():
        content = store.get(digest) if source == "value" else None
        traced_digest = digest if source == "result" else _file_named_by(content)
        camera = _camera(name) or _camera(last.step if last else "")
        maker = None if traced_digest is None else _maker(traced_digest, actions, scan, camera, above)
        place = None if last is None else last.sources.get(name)
        inputs.append(TracedInput(name, source, digest, place, content, maker))
        if maker is not None:
            _follow(maker, actions, store, scan, above, traced)
    identity = code_of(row.image, store)
    traced[key] = TracedAction(
        kind_of(row.image),
        None if last is None else last.step,
        row.image.get("parameters"),
        row.image.get("code"),
        {} if identity is None else identity.libraries,
        row.digest,
        inputs,
        row.accepted,
    )


def _maker(digest: str, actions: Actions, scan: str, camera: str | None, above: set[str]) -> str | None:
    """Key of the action with this result; never an action that came from it."""

    def rank(key: str) -> tuple[bool, bool, bool, str]:
        last = _step_of(key, actions, scan)
        name = "" if last is None else last.step
        return not name, not name.startswith(f"{scan}/"), _camera(name) != camera, key

    return min((key for key in actions.makers.get(digest, []) if key not in above), key=rank, default=None)


def _step_of(key: str, actions: Actions, scan: str) -> Latest | None:
    """The step with this last action. Equal films may give several such steps: then one of `scan` is preferred."""
    return min(
        actions.steps.get(key, []),
        key=lambda latest: (not latest.step.startswith(f"{scan}/"), latest.step),
        default=None,
    )


def _camera(name: str) -> str | None:
    """The camera's number in `extract-3` or `points-3`."""
    number = name.rpartition("-")[2]
    return number if "-" in name and number.isdecimal() else None


def _file_named_by(content: bytes | None) -> str | None:
    """The digest of a file that a value names in the form of `schemas.calibration.Source`."""
    document = parsed(content)
    if isinstance(document, dict) and document.keys() == {"name", "sha256"} and isinstance(document["sha256"], str):
        return document["sha256"]
    return None


def parsed(content: bytes | None) -> Any:
    """The JSON document that a value holds; None if it is not JSON."""
    if content is None:
        return None
    try:
        return parse_json("value", content.decode())
    except (RefusedInput, UnicodeDecodeError):
        return None
