"""`footscan trace`."""

import hashlib
import json
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.archive.selecting import WORKFLOW
from pipelines.cli.terminal.output import AsJson, message, print_json
from schemas.base.errors import RefusedInput, printable

if TYPE_CHECKING:
    from rich.tree import Tree

    from pipelines.engine.store.store import Acceptance, Store
    from pipelines.engine.trace import Trace, TracedAction, TracedInput

SHOWN_CHARACTERS = 100
"""Characters shown of a value in the tree; the JSON has all."""


def trace(
    file: Annotated[Path, typer.Argument(help="Delivered file, such as foot.stl.")],
    cache: Annotated[str | None, typer.Option(help="Result store; default: the one above the file.")] = None,
    as_json: AsJson = False,
) -> int:
    """Show the provenance of a delivered file, down to films, calibration and versions."""
    from pipelines.engine import trace as engine

    digest = _digest(file)
    store = _store(file, cache)
    place = store.files.path("").rstrip("/")
    lies_in = file.resolve().parent
    scan = f"{lies_in.parent.name}/{lies_in.name}"  # tells apart results that are equal to the byte
    found = engine.trace(digest, engine.read_actions(store), store, scan)
    if as_json:
        print_json({"file": str(file), "digest": digest, "store": place, **_json(found)})
    if found is None:
        message(f"footscan: {file}: no step made it, as far as {place} knows")
        return 1
    if not as_json:
        _print_tree(file, digest, found)
    return 0


def _digest(file: Path) -> str:
    if not file.exists():
        raise RefusedInput(file, "no such file")
    if not file.is_file():
        raise RefusedInput(file, "expected a file")
    with file.open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def _store(file: Path, cache: str | None) -> "Store":
    from pipelines.cli.archive.cache import open_place

    if cache is not None:
        return open_place(cache)
    for place in _places(file):
        if isinstance(place, str) or (place / "actions").is_dir():  # else there are notes on another store at most
            return open_place(place)
    raise RefusedInput(file, f"no {WORKFLOW} and no folder above it leads to its store, expected --cache PLACE")


def _places(file: Path) -> Iterator[Path | str]:
    """Candidates for the store: that of a workflow.yaml above the file, or a folder above the file."""
    from pipelines.archive.job import CACHE, job_of_workflow

    folders = file.resolve().parents
    for folder in folders:
        with suppress(RefusedInput):
            job = job_of_workflow(folder / WORKFLOW, may_be_empty=True)
            if job.results.resolve() in folders:
                yield job.cache
    yield from (folder / CACHE for folder in folders)


def _json(found: "Trace | None") -> dict[str, Any]:
    if found is None:
        return {"made_by": None, "actions": {}}
    return {"made_by": found.made_by, "actions": {key: _action_json(action) for key, action in found.actions.items()}}


def _action_json(action: "TracedAction") -> dict[str, Any]:
    return {
        "kind": action.kind,
        "step": action.step,
        "parameters": action.parameters,
        "code": action.code,
        "libraries": action.libraries,
        "result": action.result,
        "inputs": [_input_json(taken) for taken in action.inputs],
        **({} if action.accepted is None else {"accepted": asdict(action.accepted)}),
    }


def _input_json(taken: "TracedInput") -> dict[str, Any]:
    from pipelines.engine.trace import parsed

    facts: dict[str, Any] = {"name": taken.name, "source": taken.source, "digest": taken.digest}
    if taken.place is not None:
        facts["place"] = taken.place
    if taken.made_by is not None:
        facts["made_by"] = taken.made_by
    if taken.source == "value":
        facts["content"] = parsed(taken.content)
    return facts


def _print_tree(file: Path, digest: str, found: "Trace") -> None:
    import sys

    from rich.console import Console
    from rich.text import Text
    from rich.tree import Tree

    tree = Tree(Text(printable(f"{file}  {digest[:12]}"), style="bold"))
    _grow(tree, "", found.made_by, found, set())
    Console(width=None if sys.stdout.isatty() else 160).print(tree)


def _grow(tree: "Tree", taken_as: str, key: str, found: "Trace", shown: set[str]) -> None:
    """Add an action with its provenance; an action that has been shown is only named."""
    from rich.text import Text

    action = found.actions[key]
    name = action.step or f"{action.kind} (of an earlier run)"
    label = f"{taken_as}{name}  {(action.result or '')[:12]}"
    if key in shown:
        tree.add(Text(f"{label}  as above"))
        return
    shown.add(key)
    branch = tree.add(Text(printable("\n".join([label, *_facts(action)]), keep="\n")))
    for taken in action.inputs:
        if taken.source != "result":
            branch.add(Text(_leaf(taken)))
        elif taken.made_by is None:
            branch.add(Text(f"{taken.name}: {taken.digest[:12]}, of an action that is not in the store any more"))
        if taken.made_by is not None:
            _grow(branch, f"{taken.name}: ", taken.made_by, found, shown)


def _facts(action: "TracedAction") -> list[str]:
    values = action.parameters.get("values") if isinstance(action.parameters, dict) else None
    from schemas.base.model import canonical_json

    given = [f"{name} {canonical_json(value)}" for name, value in values.items()] if isinstance(values, dict) else []
    libraries = ", ".join(f"{name} {version}" for name, version in action.libraries.items())
    facts = [f"parameters: {', '.join(given)}"] if given else []
    facts.append(f"code: {str(action.code)[:12]} with {libraries or 'libraries that are not known any more'}")
    return facts if action.accepted is None else [*facts, _acceptance(action.accepted)]


def _acceptance(accepted: "Acceptance") -> str:
    return (
        f"accepted {accepted.date} from code {accepted.code[:12]} ({', '.join(accepted.changes)}): "
        f"{accepted.sample} of {accepted.of} computed again, all the same; {accepted.reason}"
    )


def _leaf(taken: "TracedInput") -> str:
    """The line of an input that no step made, such as a film."""
    from pipelines.engine.trace import parsed

    name = f"{taken.name}: {taken.digest[:12]}"
    if taken.source == "file":
        return f"{name}  {taken.place or 'a file; where it lay is not known any more'}"
    place = "" if taken.place is None else f"  {taken.place}"
    content = parsed(taken.content)
    if content is None:
        return (
            f"{name}{place}  a value that is not in the store any more" if taken.content is None else f"{name}{place}"
        )
    text = json.dumps(content, ensure_ascii=False)
    return f"{name}{place}  " + (text if len(text) <= SHOWN_CHARACTERS else f"{text[:SHOWN_CHARACTERS]}...")
