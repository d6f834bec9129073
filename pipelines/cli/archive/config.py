"""`footscan config`: what a workflow says, and what is wrong with it."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from pipelines.cli.archive.selecting import WORKFLOW, ProfileName, Settings, WorkflowFile
from pipelines.cli.terminal.output import AsJson, print_json, print_line, print_table
from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    from pydantic import BaseModel

config = typer.Typer(help="Check a workflow and show its parameters.", no_args_is_help=True)


@config.command("show")
def show(
    workflow: WorkflowFile = None, profile: ProfileName = None, settings: Settings = None, as_json: AsJson = False
) -> None:
    """Show every value in force and its origin: a line of the file, a profile, --set, or the default."""
    from pipelines.archive.job import overlaid_parameters, profile_of
    from pipelines.archive.settings import changed_parameters, set_names
    from pipelines.archive.workflow_file import read_workflow
    from schemas.base.json_files import read_text

    path = workflow or WORKFLOW
    document, text = read_workflow(path), read_text(path, "yaml_bytes")
    options = profile_of(path, document, profile)
    below = overlaid_parameters(document.parameters, options.parameters)
    changed, given = changed_parameters(below, settings or []), set_names(settings or [])
    sections = options.parameters.model_dump(exclude_unset=True)
    of_profile = {f"{section}.{name}" for section, values in sections.items() for name in values}
    rows = []
    for names, value in _values(document.model_copy(update={"parameters": changed})):
        name = ".".join(names)
        parameter = name.removeprefix("parameters.")
        if parameter in given:
            origin = "--set"
        elif parameter in of_profile and name != parameter:
            origin = f"profile {profile}"
        else:
            origin = _origin(document, names, text, path)
        rows.append((name, value, origin))
    if as_json:
        print_json([{"name": name, "value": value, "from": origin} for name, value, origin in rows])
    else:
        print_table(
            str(path), ["name", "value", "from"], [[name, _shown(value), origin] for name, value, origin in rows]
        )


@config.command("check")
def check(workflow: WorkflowFile = None, as_json: AsJson = False) -> int:
    """Show every mistake in a workflow, with its line and column and what was expected."""
    from pipelines.archive.workflow_file import workflow_mistakes

    path = workflow or WORKFLOW
    found = workflow_mistakes(path)
    if as_json:
        print_json([{"file": str(path), **mistake._asdict()} for mistake in found])
    for line, column, field, problem in [] if as_json else found:
        print_line(f"{path}:{line}:{column}: {field}: {problem}".replace(" : ", " "))
    if not found and not as_json:
        print_line(f"{path}: nothing is wrong")
    return RefusedInput.exit_status if found else 0


def _values(document: "BaseModel", above: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every value of a document with its path of names."""
    from pydantic import BaseModel

    for name, field in type(document).model_fields.items():
        if field.exclude:
            continue
        value = getattr(document, name)
        if isinstance(value, BaseModel):
            yield from _values(value, (*above, name))
        else:
            yield (*above, name), document.model_dump(mode="json", include={name})[name]


def _origin(document: "BaseModel", names: tuple[str, ...], text: str, path: Path) -> str:
    """The line of a value in the file; None for a default."""
    from pydantic import BaseModel

    from schemas.base.yaml_text import place_in_yaml

    for name in names:
        if name not in document.model_fields_set:
            return "default"
        value = getattr(document, name)
        if isinstance(value, BaseModel):
            document = value
    return f"{path}:{place_in_yaml(text, names)[0]}"


def _shown(value: Any) -> str:
    return "-" if value is None else str(value)
