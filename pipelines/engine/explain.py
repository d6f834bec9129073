"""The reason why a step runs: the differences between its last action and the action it would be now.

The last action is read from its pre-image. Its content is not trusted, since others may write to a store.
"""

import difflib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pipelines.engine.actions.code import CodeIdentity, code_identity, code_text
from pipelines.engine.actions.key import PreImage
from pipelines.engine.actions.step import Output, Step, Value
from pipelines.engine.files.names import plain_hex
from pipelines.engine.store.store import Store

GONE = "its result is gone"
"""Reason of a miss whose pre-image has not changed."""
BETWEEN = ("...", "...")
"""Pair of lines that marks an omission."""


@dataclass(frozen=True)
class Change:
    """One difference between two actions of a step."""

    what: str
    """`input`, `parameter`, `parameters` (their model), `code` or `library`."""
    name: str
    old: str | None
    """Old value; None if there was none. For `value` inputs and code the text, if the store still has it."""
    new: str | None
    step: str | None = None
    """The step whose result the input is, if it is one."""

    def __str__(self) -> str:
        noun = {"code": "code of ", "library": ""}.get(self.what, f"{self.what} ")
        return f"{noun}{self.name} changed"

    @property
    def with_versions(self) -> str:
        """Text of the change; for a library with both versions."""
        if self.what != "library" or self.old is None or self.new is None:
            return str(self)
        return f"{self.name} {self.old} -> {self.new}"


def changes(step: Step, old: PreImage, new: PreImage, store: Store) -> list[Change]:
    """List the differences between two pre-images of one step."""
    differences = []
    for name, was, now in _changed(inputs_of(old), inputs_of(new)):
        current = step.inputs.get(name)
        producer = current.step if isinstance(current, Output) else None
        differences.append(Change("input", name, _input_text(was, store), _input_text(now, store, current), producer))
    differences += _parameter_changes(_parameters(old), _parameters(new))
    if _field(old, "code") != _field(new, "code"):
        differences += _code_changes(step, old, store)
    return differences


def reason(differences: list[Change]) -> str:
    """Text of all changes, or `GONE` without any."""
    return ", ".join(str(change) for change in differences) or GONE


def side_by_side(change: Change) -> list[tuple[str, str]]:
    """Pairs of old and new lines of a change: the lines that differ, with one line of context before and after.

    `BETWEEN` marks omitted lines. A line that only one side has is paired with an empty line.

    Examples
    --------
    >>> side_by_side(Change("code", "module", "a = 1\\nb = 2", "a = 1\\nb = 3\\nc = 4"))
    [('a = 1', 'a = 1'), ('b = 2', 'b = 3'), ('', 'c = 4')]
    """
    old, new = (change.old or "").splitlines(), (change.new or "").splitlines()
    pairs: list[tuple[str, str]] = []
    for group in difflib.SequenceMatcher(None, old, new, autojunk=False).get_grouped_opcodes(n=1):
        if pairs:
            pairs.append(BETWEEN)
        for _, i, i_end, j, j_end in group:
            count = max(i_end - i, j_end - j)
            left, right = old[i:i_end], new[j:j_end]
            left += [""] * (count - len(left))
            right += [""] * (count - len(right))
            pairs += zip(left, right, strict=True)
    return pairs


def kind_of(image: Any) -> str:
    """The kind of step that a pre-image names, or `unknown`."""
    kind = _field(image, "step")
    return kind if isinstance(kind, str) else "unknown"


def inputs_of(image: Any) -> dict[str, tuple[str, str]]:
    """The inputs that a pre-image names: for each its source (`value`, `file` or `result`) and its digest."""
    inputs = {}
    for name, pair in _mapping(image, "inputs").items():
        match pair:
            case [str(source), str(digest)] if _is_digest(digest):
                inputs[name] = (source, digest)
    return inputs


def code_of(image: Any, store: Store) -> CodeIdentity | None:
    """Identity of the code of an action; None if the store has lost its document."""
    try:
        was = json.loads(store.get(_field(image, "code")) or b"")
        modules = {name: plain_hex(digest) for name, digest in was["modules"].items()}
        return CodeIdentity(modules, {name: str(version) for name, version in was["libraries"].items()})
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def _parameter_changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Change]:
    for name, was, now in _changed(_mapping(old, "values"), _mapping(new, "values")):
        yield Change("parameter", name, _json_text(was), _json_text(now))
    if old and new and old.get("model") != new.get("model"):
        yield Change("parameters", "model", _json_text(old.get("model")), _json_text(new.get("model")))


def _code_changes(step: Step, old: PreImage, store: Store) -> Iterator[Change]:
    was, now = code_of(old, store), code_identity(step.module)
    if was is None:
        yield Change("code", step.module, None, None)
        return
    for name, old_digest, new_digest in _changed(was.modules, now.modules):
        old_text = None if old_digest is None else store.get(old_digest)
        new_text = None if new_digest is None else code_text(name)
        yield Change("code", name, _text(old_text), _text(new_text))
    for name, old_version, new_version in _changed(was.libraries, now.libraries):
        yield Change("library", name, old_version, new_version)


def _input_text(source_and_digest: tuple[str, str] | None, store: Store, current: object = None) -> str | None:
    """Text of an input: the content of a JSON value, or else the digest."""
    if source_and_digest is None:
        return None
    source, digest = source_and_digest
    if source != "value":
        return digest
    content = current.content if isinstance(current, Value) else store.get(digest)
    try:
        return digest if content is None else json.dumps(json.loads(content), indent=1, sort_keys=True)
    except (ValueError, RecursionError):
        return digest


def _parameters(image: Any) -> Mapping[str, Any]:
    return _mapping(image, "parameters")


def _mapping(value: Any, name: str) -> Mapping[str, Any]:
    field = _field(value, name)
    return field if isinstance(field, dict) else {}


def _field(value: Any, name: str) -> Any:
    return value.get(name) if isinstance(value, dict) else None


def _is_digest(text: str) -> bool:
    try:
        plain_hex(text)
    except ValueError:
        return False
    return True


def _json_text(value: Any) -> str | None:
    return None if value is None else json.dumps(value)


def _text(data: bytes | None) -> str | None:
    return None if data is None else data.decode(errors="replace")


def _changed(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    for name in sorted(old.keys() | new.keys()):
        if old.get(name) != new.get(name):
            yield name, old.get(name), new.get(name)
