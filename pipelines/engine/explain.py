"""Why a step runs: what its last action took, beside what it would take now.

What an action took is read out of its pre-image, which may be anything: a store can be written to by others.
"""

import difflib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pipelines.engine.actions.code import CodeIdentity, code_identity, code_text
from pipelines.engine.actions.key import PreImage
from pipelines.engine.actions.step import Output, Step, Value
from pipelines.engine.store.store import Store, plain_hex

GONE = "its result is gone"
BETWEEN = ("...", "...")
"""Stands between lines that do not follow each other."""


@dataclass(frozen=True)
class Change:
    """One thing that is not what it was."""

    what: str
    """`input`, `parameter`, `parameters` (their model), `code` or `library`."""
    name: str
    old: str | None
    """None where it was not there; for `value` inputs and code the text itself, if the store still has it."""
    new: str | None
    step: str | None = None
    """Of an input: the step whose result it is."""

    def __str__(self) -> str:
        noun = {"code": "code of ", "library": ""}.get(self.what, f"{self.what} ")
        return f"{noun}{self.name} changed"

    @property
    def with_versions(self) -> str:
        """The change in words, with both versions of a library."""
        if self.what != "library" or self.old is None or self.new is None:
            return str(self)
        return f"{self.name} {self.old} -> {self.new}"


def changes(step: Step, old: PreImage, new: PreImage, store: Store) -> list[Change]:
    """What differs between two pre-images of one step."""
    found = []
    for name, was, now in _changed(inputs_of(old), inputs_of(new)):
        given = step.inputs.get(name)
        before = given.step if isinstance(given, Output) else None
        found.append(Change("input", name, _input_text(was, store), _input_text(now, store, given), before))
    found += _parameter_changes(_parameters(old), _parameters(new))
    if _field(old, "code") != _field(new, "code"):
        found += _code_changes(step, old, store)
    return found


def reason(found: list[Change]) -> str:
    """The changes in words."""
    return ", ".join(str(change) for change in found) or GONE


def side_by_side(change: Change) -> list[tuple[str, str]]:
    """Old and new text of a change, line by line: those that differ with a line around them, `BETWEEN` where lines are
    left out. Lines that are on one side only stand beside an empty one."""
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
    """The kind of step that a pre-image says it is of."""
    kind = _field(image, "step")
    return kind if isinstance(kind, str) else "unknown"


def inputs_of(image: Any) -> dict[str, tuple[str, str]]:
    """What a pre-image says of its inputs: for each `value`, `file` or `result`, and the digest."""
    named = _field(image, "inputs")
    found = {}
    for name, pair in named.items() if isinstance(named, dict) else ():
        match pair:
            case [str(source), str(digest)] if _is_digest(digest):
                found[name] = (source, digest)
    return found


def code_of(image: Any, store: Store) -> CodeIdentity | None:
    """The code of an action, as far as the store still has it."""
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
    for name, before, after in _changed(was.modules, now.modules):
        text = None if before is None else store.get(before)
        new = None if after is None else code_text(name)
        yield Change("code", name, _text(text), _text(new))
    for name, before, after in _changed(was.libraries, now.libraries):
        yield Change("library", name, before, after)


def _input_text(named: tuple[str, str] | None, store: Store, given: object = None) -> str | None:
    """What an input is: the content of a small value, otherwise its digest."""
    if named is None:
        return None
    source, digest = named
    if source != "value":
        return digest
    content = given.content if isinstance(given, Value) else store.get(digest)
    try:
        return digest if content is None else json.dumps(json.loads(content), indent=1, sort_keys=True)
    except (ValueError, RecursionError):
        return digest


def _parameters(image: Any) -> Mapping[str, Any]:
    return _mapping(image, "parameters")


def _mapping(value: Any, name: str) -> Mapping[str, Any]:
    found = _field(value, name)
    return found if isinstance(found, dict) else {}


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
