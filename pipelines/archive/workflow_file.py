"""Reading workflow.yaml: all its mistakes are reported at once, each with line and column."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from schemas.base.errors import RefusedInput
from schemas.base.json_files import read_text, validate
from schemas.base.mistakes import Mistake, mistakes
from schemas.base.yaml_files import read_yaml_text
from schemas.base.yaml_text import place_in_yaml
from schemas.workflow import Workflow


class PlacedMistake(NamedTuple):
    """One mistake in a workflow.yaml, with its place."""

    line: int
    column: int
    field: str
    """Path of the field, names joined by dots; empty for the document as a whole."""
    problem: str


def read_workflow(path: Path) -> Workflow:
    """Read the workflow in `path`.

    Raises
    ------
    RefusedInput
        The file is missing, is not YAML, or breaks its format. The error is the first mistake in the file; `others`
        holds the further ones.
    """
    text, value = _parsed(path)
    document = _validated(text, value)
    if isinstance(document, list):
        raise _refusal(path, _in_order([*document, *_missing_files(path, text, value)]))
    return document


def is_url(place: str) -> bool:
    """Return True for a place of fsspec, such as `s3://feet/archive`, and False for a path."""
    return "://" in place


def check_archives(path: Path, document: Workflow) -> None:
    """Raise RefusedInput if an archive of the workflow in `path` is missing; it names all missing files."""
    if not all(is_url(archive) or (path.resolve().parent / archive).is_dir() for archive in document.archive):
        text, value = _parsed(path)
        raise _refusal(path, _missing_files(path, text, value))


def workflow_mistakes(path: Path) -> list[PlacedMistake]:
    """List all mistakes in a workflow in the order of the file; missing files that it names count as well.

    A text that is not YAML is refused, as in `read_workflow`.
    """
    text, value = _parsed(path)
    document = _validated(text, value)
    missing = _missing_files(path, text, value)
    return _in_order([*document, *missing]) if isinstance(document, list) else missing


def _parsed(path: Path) -> tuple[str, dict[str, Any]]:
    if not path.exists():
        raise RefusedInput(path, "no such file, expected a workflow, which 'footscan init' writes")
    text = read_text(path, "yaml_bytes")
    value = read_yaml_text(path, text)
    if not isinstance(value, dict):
        validate(path, Workflow, value)
    return text, value


def _validated(text: str, value: dict[str, Any]) -> Workflow | list[PlacedMistake]:
    try:
        return Workflow.model_validate(value)
    except ValidationError as error:
        return _placed(text, mistakes(Workflow, error))


def _missing_files(path: Path, text: str, value: dict[str, Any]) -> list[PlacedMistake]:
    """A mistake for each file or folder that the workflow names and that is missing; other mistakes may be in it."""
    found: list[Mistake] = []

    def check(names: tuple[str | int, ...], named: Any, kind: str) -> None:
        what, is_there = _EXPECTED[kind]
        if not isinstance(named, str) or not named or "\0" in named or (kind == "archive" and is_url(named)):
            return
        if not is_there(path.resolve().parent / named):
            found.append(Mistake(names, f"no such {what}, found {named[:80]!r}", is_name=False))

    archives = value.get("archive")
    for number, archive in enumerate(archives if isinstance(archives, list) else [archives]):
        check(("archive", number), archive, "archive")
    check(("calibration",), value.get("calibration"), "file")
    check(("size_table",), value.get("size_table"), "table")
    calibrations = value.get("calibrations")
    for number, chosen in enumerate(calibrations if isinstance(calibrations, list) else []):
        for kind in ("file", "capture") if isinstance(chosen, dict) else ():
            check(("calibrations", number, kind), chosen.get(kind), kind)
    return _placed(text, found)


_EXPECTED: dict[str, tuple[str, Callable[[Path], bool]]] = {
    "archive": ("folder, expected one with scans", Path.is_dir),
    "file": ("file, expected a calibration", Path.is_file),
    "table": ("file, expected a table of sizes", Path.is_file),
    "capture": ("folder, expected a capture", Path.is_dir),
}


def _placed(text: str, unplaced: Sequence[Mistake]) -> list[PlacedMistake]:
    """The mistakes with their places, in the order of the file."""
    placed = [
        PlacedMistake(
            *place_in_yaml(text, mistake.path, of_name=mistake.is_name),
            ".".join(map(str, mistake.path)),
            mistake.problem,
        )
        for mistake in unplaced
    ]
    return _in_order(placed)


def _in_order(placed: Sequence[PlacedMistake]) -> list[PlacedMistake]:
    """The mistakes in the order of the file."""
    return sorted(placed, key=lambda mistake: (mistake.line, mistake.column))


def _refusal(path: Path, placed: Sequence[PlacedMistake]) -> RefusedInput:
    refusals = [
        RefusedInput(path, f"{problem} (line {line}, column {column})" if field else problem, field=field or None)
        for line, column, field, problem in placed
    ]
    if len(refusals) > 1:
        refusals.append(RefusedInput(path, f"{len(placed)} mistakes, see 'footscan config check {path}'"))
    refusals[0].others = tuple(refusals[1:])
    return refusals[0]
