"""Reading workflow.yaml: every mistake in it has its place, and all are told at once."""

from collections.abc import Iterator, Sequence
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
    """One mistake, and where in the file it stands."""

    line: int
    column: int
    field: str
    """Names that lead to it, joined by dots; empty for the document as a whole."""
    problem: str


def read_workflow(path: Path) -> Workflow:
    """The workflow in `path`.

    Raises
    ------
    RefusedInput
        The file is missing, no YAML, or breaks its format: the first mistake in the order of the file, and behind it
        all others.
    """
    text, value = _parsed(path)
    document = _validated(text, value)
    if isinstance(document, list):
        raise _refusal(path, document)
    return document


def check_archives(path: Path, document: Workflow) -> None:
    """Refuse the workflow in `path` if an archive of it is not there, and tell what else is not there."""
    if not all((path.resolve().parent / archive).is_dir() for archive in document.archive):
        raise _refusal(path, _missing_files(path, read_text(path, "yaml_bytes"), document))


def workflow_mistakes(path: Path) -> list[PlacedMistake]:
    """All that is wrong with a workflow, in the order of the file; what it names and is not there, too.

    A text that is no YAML has one mistake, and is refused as by any other command.
    """
    text, value = _parsed(path)
    document = _validated(text, value)
    return document if isinstance(document, list) else _missing_files(path, text, document)


def _parsed(path: Path) -> tuple[str, dict[str, Any]]:
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


def _missing_files(path: Path, text: str, document: Workflow) -> list[PlacedMistake]:
    return _placed(text, [Mistake(names, problem, is_name=False) for names, problem in _not_there(path, document)])


def _not_there(path: Path, document: Workflow) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What the workflow names and is not there."""
    base = path.resolve().parent
    for number, archive in enumerate(document.archive):
        if not (base / archive).is_dir():
            yield ("archive", number), f"no such folder, expected one with scans, found {archive[:80]!r}"
    files: list[tuple[tuple[str | int, ...], str]] = [
        (("calibrations", n, "file"), c.file) for n, c in enumerate(document.calibrations) if c.file is not None
    ]
    if document.calibration is not None:
        files.append((("calibration",), document.calibration))
    for names, file in files:
        if not (base / file).is_file():
            yield names, f"no such file, expected a calibration, found {file[:80]!r}"
    for number, chosen in enumerate(document.calibrations):
        if chosen.capture is not None and not (base / chosen.capture).is_dir():
            problem = f"no such folder, expected a capture, found {chosen.capture[:80]!r}"
            yield ("calibrations", number, "capture"), problem


def _placed(text: str, found: Sequence[Mistake]) -> list[PlacedMistake]:
    """Mistakes in the order of the file."""
    placed = [
        PlacedMistake(
            *place_in_yaml(text, mistake.path, of_name=mistake.is_name),
            ".".join(map(str, mistake.path)),
            mistake.problem,
        )
        for mistake in found
    ]
    return sorted(placed, key=lambda mistake: (mistake.line, mistake.column))


def _refusal(path: Path, found: Sequence[PlacedMistake]) -> RefusedInput:
    refusals = [
        RefusedInput(path, f"{problem} (line {line}, column {column})" if field else problem, field=field or None)
        for line, column, field, problem in found
    ]
    refusals[0].others = tuple(refusals[1:])
    return refusals[0]
