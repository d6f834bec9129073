"""Everything that a result came from, as the rows of a store tell it."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import PurePosixPath
from typing import Any

from pipelines.engine.explain import code_of, inputs_of, kind_of
from pipelines.engine.store.store import Acceptance, Latest, Row, Store
from schemas.base.errors import RefusedInput
from schemas.base.json_files import parse_json


@dataclass(frozen=True)
class Actions:
    """All that a store knows of actions; what is damaged is left out, and was said."""

    rows: dict[str, Row]
    """By key."""
    latest: list[Latest]

    @cached_property
    def makers(self) -> dict[str, list[str]]:
        """Keys of the actions that came to a result, by its digest."""
        found: dict[str, list[str]] = {}
        for key, row in self.rows.items():
            if row.digest is not None:
                found.setdefault(row.digest, []).append(key)
        return found

    @cached_property
    def steps(self) -> dict[str, list[Latest]]:
        """The steps whose last action it was, by its key."""
        found: dict[str, list[Latest]] = {}
        for latest in self.latest:
            found.setdefault(latest.key, []).append(latest)
        return found


@dataclass(frozen=True)
class TracedInput:
    """What an action took."""

    name: str
    source: str
    """`value`, `file` or `result`."""
    digest: str
    place: str | None
    """Where a file lay; None where that is not known any more."""
    content: bytes | None
    """Of a value, if the store still has it."""
    made_by: str | None
    """Key of the action that it is the result of."""


@dataclass(frozen=True)
class TracedAction:
    """An action, as its row has it."""

    kind: str
    step: str | None
    """Name of the step; None where its last action was another."""
    parameters: Any
    """Model and values; None for a step without parameters."""
    code: str | None
    libraries: dict[str, str]
    """Empty where the store has the code no more."""
    result: str | None
    inputs: list[TracedInput] = field(default_factory=list)
    accepted: Acceptance | None = None
    """Where the result is an earlier version's: which, and why it stands."""


@dataclass(frozen=True)
class Trace:
    """A result and all actions that it came from."""

    made_by: str
    actions: dict[str, TracedAction]
    """By key; none came from itself."""


def read_actions(store: Store) -> Actions:
    """Reads all rows of a store."""
    rows = {}
    for name, _ in store.files.sizes("actions"):
        key = row_key(name)
        row = None if key is None else store.row(key)
        if key is not None and row is not None and isinstance(row.image, dict):  # which a row made by hand need not be
            rows[key] = row
    names = (name for name, _ in store.files.sizes("latest") if name.endswith(".json"))
    latest = (store.read_latest(name) for name in names)
    return Actions(rows, [one for one in latest if one is not None])


def row_key(name: str) -> str | None:
    """The key that a file among the rows is named for; None for another file."""
    path = PurePosixPath(name)
    is_row = path.suffix == ".json" and _is_hex(path.stem) and path.parts[:2] == ("actions", path.stem[:2])
    return path.stem if is_row and len(path.parts) == 3 else None


def blob_digest(name: str) -> str | None:
    """The digest that a file among the blobs is named for; None for another file."""
    parts = PurePosixPath(name).parts
    is_blob = len(parts) == 3 and parts[0] == "blobs" and _is_hex(parts[2]) and parts[1] == parts[2][:2]
    return parts[2] if is_blob else None


def trace(digest: str, actions: Actions, store: Store, scan: str = "") -> Trace | None:
    """What the result `digest` came from; None where no action came to it.

    Results can be equal to the byte. Which of their actions is meant is then told by the scan (`patient/scan`) and by
    the camera.
    """
    found: dict[str, TracedAction] = {}
    key = _maker(digest, actions, scan, None, set())
    if key is None:
        return None
    _follow(key, actions, store, scan, set(), found)
    return Trace(key, found)


def _follow(
    key: str, actions: Actions, store: Store, scan: str, above: set[str], found: dict[str, TracedAction]
) -> None:
    if key in found:
        return
    row, last = actions.rows[key], _step_of(key, actions, scan)
    scan = scan or (last.step.rpartition("/")[0] if last else "")
    above = above | {key}
    inputs = []
    for name, (source, digest) in inputs_of(row.image).items():
        content = store.get(digest) if source == "value" else None
        wanted = digest if source == "result" else _file_named_by(content)
        camera = _camera(name) or _camera(last.step if last else "")
        maker = None if wanted is None else _maker(wanted, actions, scan, camera, above)
        place = None if last is None else last.sources.get(name)
        inputs.append(TracedInput(name, source, digest, place, content, maker))
        if maker is not None:
            _follow(maker, actions, store, scan, above, found)
    identity = code_of(row.image, store)
    found[key] = TracedAction(
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
    """The action that came to a result; never one that came from it."""

    def strangeness(key: str) -> tuple[bool, bool, bool, str]:
        last = _step_of(key, actions, scan)
        name = "" if last is None else last.step
        return not name, not name.startswith(f"{scan}/"), _camera(name) != camera, key

    return min((key for key in actions.makers.get(digest, []) if key not in above), key=strangeness, default=None)


def _step_of(key: str, actions: Actions, scan: str) -> Latest | None:
    """The step whose last action it was; rather one of `scan` where equal films made it that of several."""
    return min(
        actions.steps.get(key, []), key=lambda one: (not one.step.startswith(f"{scan}/"), one.step), default=None
    )


def _camera(name: str) -> str | None:
    """The camera's number in `extract-3` or `points-3`."""
    number = name.rpartition("-")[2]
    return number if "-" in name and number.isdecimal() else None


def _file_named_by(content: bytes | None) -> str | None:
    """The digest of a file that a value names, as `schemas.calibration.Source` does."""
    document = parsed(content)
    if isinstance(document, dict) and document.keys() == {"name", "sha256"} and isinstance(document["sha256"], str):
        return document["sha256"]
    return None


def parsed(content: bytes | None) -> Any:
    """A value as the JSON document that it is; None for another."""
    if content is None:
        return None
    try:
        return parse_json("value", content.decode())
    except (RefusedInput, UnicodeDecodeError):
        return None


def _is_hex(text: str) -> bool:
    return len(text) == 64 and set("0123456789abcdef").issuperset(text)
