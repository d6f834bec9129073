"""Reading of the project's YAML documents, with one clear line for each mistake."""

from pathlib import Path
from typing import Any

from schemas.base.errors import RefusedInput
from schemas.base.json_files import encodable, read_text, validate
from schemas.base.mistakes import Mistake
from schemas.base.model import AnyDocument
from schemas.base.yaml_text import parse_yaml, place_in_yaml


def read_yaml(path: Path, model: type[AnyDocument]) -> AnyDocument:
    """The YAML file `path` as `model`.

    Raises
    ------
    RefusedInput
        The file is missing, too large, no YAML, or breaks the model; one line names file, field and expectation.
    """
    text = read_text(path, "yaml_bytes")
    return validate(path, model, read_yaml_text(path, text), lambda mistake: _in_brackets(text, mistake))


def read_yaml_text(path: Path, text: str) -> Any:
    """The value of the YAML `text`, the content of `path`; RefusedInput if it is not YAML."""
    try:
        value = parse_yaml(text)
    except ValueError as error:
        raise RefusedInput(path, str(error)) from None
    try:
        return encodable(value)
    except ValueError as error:
        raise RefusedInput(path, f"expected YAML ({error})") from None


def line_and_column(text: str, mistake: Mistake) -> str:
    """The position of a mistake in a YAML `text`; that of the section if a field is missing."""
    line, column = place_in_yaml(text, mistake.path, of_name=mistake.is_name)
    return f"line {line}, column {column}"


def _in_brackets(text: str, mistake: Mistake) -> str:
    return f" ({line_and_column(text, mistake)})" if mistake.path else ""
