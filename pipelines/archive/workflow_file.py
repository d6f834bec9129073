"""Reading workflow.yaml: all its mistakes are reported at once, each with line and column."""

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
        raise _refusal(path, document)
    return document


def check_archives(path: Path, document: Workflow) -> None:
    """Raise RefusedInput if an archive of the workflow in `path` is missing; it names all missing files."""
    if not all((path.resolve().parent / archive).is_dir() for archive in document.archive):
        raise _refusal(path, _missing_files(path, read_text(path, "yaml_bytes"), document))


def workflow_mistakes(path: Path) -> list[PlacedMistake]:
    """List all mistakes in a workflow in the order of the file; missing files that it names count as well.

    A text that is not YAML is refused, as in `read_workflow`.
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
    return _placed(text, [Mistake(names, problem, is_name=False) for names, problem in _missing(path, document)])


def _missing(path: Path, document: Workflow) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Path of the field and problem for each file or folder that the workflow names and that is missing."""
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
    for number, calibration in enumerate(document.calibrations):
        if calibration.capture is not None and not (base / calibration.capture).is_dir():
            problem = f"no such folder, expected a capture, found {calibration.capture[:80]!r}"
            yield ("calibrations", number, "capture"), problem


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
    return sorted(placed, key=lambda mistake: (mistake.line, mistake.column))


def _refusal(path: Path, placed: Sequence[PlacedMistake]) -> RefusedInput:
    refusals = [
        RefusedInput(path, f"{problem} (line {line}, column {column})" if field else problem, field=field or None)
        for line, column, field, problem in placed
    ]
    refusals[0].others = tuple(refusals[1:])
    return refusals[0]
