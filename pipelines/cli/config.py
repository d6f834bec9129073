"""`footscan config`: what a workflow says, and what is wrong with it."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from pipelines.cli.output import AsJson, print_json, print_line, print_table
from pipelines.cli.runs import WORKFLOW, Settings, WorkflowFile
from schemas.errors import RefusedInput

if TYPE_CHECKING:
    from pydantic import BaseModel

    from schemas.workflow import Workflow

config = typer.Typer(help="What a workflow says, and what is wrong with it.", no_args_is_help=True)


@config.command("show")
def show(workflow: WorkflowFile = None, settings: Settings = None, as_json: AsJson = False) -> None:
    """Every value in force, and where it comes from: a line of the file, --set, or the default."""
    from schemas.documents import read_text, read_yaml
    from schemas.overrides import overridden, parse_settings
    from schemas.workflow import ScanParameters, Workflow

    path = workflow or WORKFLOW
    document, text = read_yaml(path, Workflow), read_text(path)
    given = parse_settings(settings or [])
    changed = overridden(ScanParameters, document.parameters.model_dump(mode="json"), settings or [])
    rows = []
    for names, value in _values(document.model_copy(update={"parameters": changed})):
        name = ".".join(names)
        origin = "--set" if name.removeprefix("parameters.") in given else _origin(document, names, text, path)
        rows.append((name, value, origin))
    if as_json:
        print_json([{"name": name, "value": value, "from": origin} for name, value, origin in rows])
    else:
        print_table(
            str(path), ["name", "value", "from"], [[name, _shown(value), origin] for name, value, origin in rows]
        )


@config.command("check")
def check(workflow: WorkflowFile = None, as_json: AsJson = False) -> int:
    """Every mistake in a workflow, with its line and column and what was expected."""
    found = [*_mistakes(workflow or WORKFLOW)]
    if as_json:
        print_json(found)
    for mistake in [] if as_json else found:
        print_line("{file}:{line}:{column}: {field}: {problem}".format_map(mistake).replace(" : ", " "))
    if not found and not as_json:
        print_line(f"{workflow or WORKFLOW}: nothing is wrong")
    return RefusedInput.exit_status if found else 0


def _mistakes(path: Path) -> Iterator[dict[str, Any]]:
    """All that is wrong; a text that is no YAML has one mistake, and is told as by any other command."""
    from pydantic import ValidationError

    from schemas.documents import read_text, read_yaml_text, validate
    from schemas.mistakes import Mistake, mistakes
    from schemas.workflow import Workflow
    from schemas.yaml_text import place_in_yaml

    text = read_text(path)
    value = read_yaml_text(path, text)
    if not isinstance(value, dict):
        validate(path, Workflow, value)
    try:
        document = Workflow.model_validate(value)
        found = [Mistake(names, problem, is_name=False) for names, problem in _missing_files(path, document)]
    except ValidationError as error:
        found = mistakes(Workflow, error)
    for mistake in sorted(found, key=lambda mistake: place_in_yaml(text, mistake.path, of_name=mistake.is_name)):
        line, column = place_in_yaml(text, mistake.path, of_name=mistake.is_name)
        field = ".".join(map(str, mistake.path))
        yield {"file": str(path), "line": line, "column": column, "field": field, "problem": mistake.problem}


def _missing_files(path: Path, document: "Workflow") -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What the workflow names and is not there."""
    base = path.resolve().parent
    for number, archive in enumerate(document.archive):
        if not (base / archive).is_dir():
            yield ("archive", number), f"no such folder, expected one with scans, found {archive[:80]!r}"
    files: list[tuple[tuple[str | int, ...], str]] = [
        (("calibrations", n, "file"), c.file) for n, c in enumerate(document.calibrations)
    ]
    if document.calibration is not None:
        files.append((("calibration",), document.calibration))
    for names, file in files:
        if not (base / file).is_file():
            yield names, f"no such file, expected a calibration, found {file[:80]!r}"


def _values(document: "BaseModel", above: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every value of a document, after the names that lead to it."""
    from pydantic import BaseModel

    for name in type(document).model_fields:
        value = getattr(document, name)
        if isinstance(value, BaseModel):
            yield from _values(value, (*above, name))
        else:
            yield (*above, name), document.model_dump(mode="json", include={name})[name]


def _origin(document: "BaseModel", names: tuple[str, ...], text: str, path: Path) -> str:
    """The line of a value that the file holds; otherwise it is the default."""
    from pydantic import BaseModel

    from schemas.yaml_text import place_in_yaml

    for name in names:
        if name not in document.model_fields_set:
            return "default"
        value = getattr(document, name)
        if isinstance(value, BaseModel):
            document = value
    return f"{path}:{place_in_yaml(text, names)[0]}"


def _shown(value: Any) -> str:
    return "-" if value is None else str(value)
