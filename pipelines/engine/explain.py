"""Why a step runs: what its last action took, beside what it would take now."""

import difflib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pipelines.engine.code import code_identity
from pipelines.engine.key import PreImage
from pipelines.engine.step import Step, Value
from pipelines.engine.store import Store

GONE = "its result is gone"


@dataclass(frozen=True)
class Change:
    """One thing that is not what it was."""

    what: str
    """`input`, `parameter`, `code` or `library`."""
    name: str
    old: str | None
    """None where it was not there; for `value` inputs and code the text itself, if the store still has it."""
    new: str | None

    def __str__(self) -> str:
        noun = {"code": "code of ", "library": ""}.get(self.what, f"{self.what} ")
        return f"{noun}{self.name} changed"


def changes(step: Step, old: PreImage, new: PreImage, store: Store) -> list[Change]:
    """What differs between two pre-images of one step."""
    found = [
        Change("input", name, _input_text(was, store), _input_text(now, store, step.inputs.get(name)))
        for name, was, now in _changed(old.get("inputs"), new.get("inputs"))
    ]
    was, now = old.get("parameters") or {}, new.get("parameters") or {}
    found += [
        Change("parameter", name, _json_text(before), _json_text(after))
        for name, before, after in _changed(was.get("values"), now.get("values"))
    ]
    if old.get("code") != new.get("code"):
        found += _code_changes(step, old, store)
    return found


def reason(found: list[Change]) -> str:
    """The changes in words."""
    return ", ".join(str(change) for change in found) or GONE


def differing_lines(change: Change) -> Iterator[str]:
    """Old and new text of a change, the lines that differ with those around them."""
    old, new = (change.old or "").splitlines(), (change.new or "").splitlines()
    return (line for line in difflib.unified_diff(old, new, lineterm="", n=1) if not line.startswith(("---", "+++")))


def _code_changes(step: Step, old: PreImage, store: Store) -> Iterator[Change]:
    identity = code_identity(step.module)
    document = store.get(old["code"])
    if document is None:
        yield Change("code", step.module, None, None)
        return
    was = json.loads(document)
    texts = dict(zip(identity.modules, identity.texts, strict=True))
    for name, before, _ in _changed(was["modules"], identity.modules):
        text = None if before is None else store.get(before)
        new = texts.get(name)
        yield Change("code", name, None if text is None else text.decode(), None if new is None else new.decode())
    for name, before, after in _changed(was["libraries"], identity.libraries):
        yield Change("library", name, before, after)


def _input_text(named: list[str] | None, store: Store, given: object = None) -> str | None:
    """What an input is: the content of a small value, otherwise its digest."""
    if named is None:
        return None
    kind, digest = named
    if kind != "value":
        return digest
    content = given.content if isinstance(given, Value) else store.get(digest)
    try:
        return digest if content is None else json.dumps(json.loads(content), indent=1, sort_keys=True)
    except ValueError:
        return digest


def _json_text(value: Any) -> str | None:
    return None if value is None else json.dumps(value)


def _changed(old: Mapping[str, Any] | None, new: Mapping[str, Any] | None) -> Iterator[tuple[str, Any, Any]]:
    old, new = old or {}, new or {}
    for name in sorted(old.keys() | new.keys()):
        if old.get(name) != new.get(name):
            yield name, old.get(name), new.get(name)
