"""Reading and writing of the project's YAML and JSON documents, as pydantic models, with one clear line per mistake."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError

from schemas.base.errors import RefusedInput
from schemas.base.limits import read_bounded, refuse_beyond
from schemas.base.mistakes import Mistake, mistakes
from schemas.base.yaml_text import parse_yaml, place_in_yaml


def _pseudonym(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,64}", name):
        raise ValueError("expected 1 to 64 letters, digits, '-' and '_'")
    return name


Pseudonym = Annotated[str, AfterValidator(_pseudonym)]
"""A name that may become a folder: letters, digits, '-' and '_', 1 to 64 of them."""


Side = Literal["right", "left", "unknown"]
"""Which foot it is."""


def _relative(path: str) -> str:
    if not path or "\0" in path or path.startswith(("/", "\\", "~")) or ":" in path.split("/", maxsplit=1)[0]:
        raise ValueError("expected a path relative to this file")
    return path


RelativePath = Annotated[str, AfterValidator(_relative)]
"""A path relative to the document that names it. `inside` resolves it within an archive."""


class Document(BaseModel):
    """Base of all models: unknown fields are refused (a misspelt option must not be ignored), numbers are finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, protected_namespaces=())


AnyDocument = TypeVar("AnyDocument", bound=BaseModel)


def read_yaml(path: Path, model: type[AnyDocument]) -> AnyDocument:
    """The YAML file `path` as `model`.

    Raises
    ------
    RefusedInput
        The file is missing, too large, no YAML, or breaks the model; one line names file, field and expectation.
    """
    text = read_text(path, "yaml_bytes")
    return validate(path, model, read_yaml_text(path, text), lambda mistake: _in_brackets(text, mistake))


def read_json(path: Path, model: type[AnyDocument]) -> AnyDocument:
    """The JSON file `path` as `model`; errors as in `read_yaml`."""
    return validate(path, model, parse_json(path, read_text(path, "json_bytes")))


def parse_json(source: Path | str, text: str) -> Any:
    """`text` as JSON without NaN, infinities and names that stand twice; BeyondLimitError of too many values."""
    refuse_beyond("json_values", text.count(","), source)
    try:
        return _encodable(json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_refuse_twice))
    except (ValueError, RecursionError) as error:
        raise RefusedInput(source, f"expected a JSON document ({error})") from None


def canonical_json(value: Any) -> str:
    """JSON that is the same for equal values: sorted keys, no spaces, no NaN."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)


def read_yaml_text(path: Path, text: str) -> Any:
    """`text`, the content of `path`, as YAML has it; RefusedInput where it is none."""
    try:
        value = parse_yaml(text)
    except ValueError as error:
        raise RefusedInput(path, str(error)) from None
    try:
        return _encodable(value)
    except ValueError as error:
        raise RefusedInput(path, f"expected YAML ({error})") from None


def line_and_column(text: str, mistake: Mistake) -> str:
    """Where in a YAML `text` a mistake stands; that of its section where a field is missing."""
    line, column = place_in_yaml(text, mistake.path, of_name=mistake.is_name)
    return f"line {line}, column {column}"


def _in_brackets(text: str, mistake: Mistake) -> str:
    return f" ({line_and_column(text, mistake)})" if mistake.path else ""


def validate(
    source: Path | str,
    model: type[AnyDocument],
    value: Any,
    place: Callable[[Mistake], str] | None = None,
) -> AnyDocument:
    """`value` as `model`, or one line that names the first wrong field; `place` may say where it stands."""
    if not isinstance(value, dict):
        raise RefusedInput(source, f"expected a document with named fields, found {_kind(value)}")
    try:
        return model.model_validate(value)
    except ValidationError as error:
        first = mistakes(model, error, most=1)[0]
        field = ".".join(str(name)[:80] for name in first.path) or None
        raise RefusedInput(source, first.problem + (place(first) if place else ""), field=field) from None


def pseudonym(name: str, field: str) -> str:
    """`name`, or a refusal where it could not be a folder."""
    try:
        return _pseudonym(name)
    except ValueError as error:
        raise RefusedInput(field, f"{error}, found {name[:80]!r}") from None


def inside(archive: Path, document: Path, relative: str, field: str) -> Path:
    """The file that `document` names by `relative`, which may not lie outside `archive`, symbolic links followed."""
    try:
        path = (document.parent / relative).resolve()
    except (OSError, RuntimeError):  # before Python 3.13 a circle of links is a RuntimeError
        raise RefusedInput(document, f"{relative[:80]!r} leads nowhere, expected a path", field=field) from None
    if not path.is_relative_to(archive.resolve()):
        raise RefusedInput(document, f"{relative!r} leaves the archive, expected a path inside it", field=field)
    return path


def read_text(path: Path, bound: str) -> str:
    """The content of a UTF-8 file; RefusedInput where it is none, or larger than the `bound` of that name allows."""
    try:
        return read_bounded(path, bound).decode("utf-8")
    except UnicodeDecodeError:
        raise RefusedInput(path, "expected UTF-8 text") from None
    except FileNotFoundError:
        raise RefusedInput(path, "no such file") from None
    except (OSError, ValueError) as error:
        raise RefusedInput(path, f"cannot be read ({getattr(error, 'strerror', None) or error})") from None


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON number")


def _refuse_twice(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    names: set[str] = set()
    for name, _ in pairs:
        if name in names:
            raise ValueError(f"{name[:80]!r} stands twice, expected each name once")
        names.add(name)
    return dict(pairs)


def _encodable(value: Any) -> Any:
    """`value`; ValueError where an escape like \\ud800 has made text that is none and could not be written again."""
    json.dumps(value, ensure_ascii=False).encode()
    return value


def _kind(value: Any) -> str:
    return {list: "a list", str: "text", type(None): "nothing"}.get(type(value), type(value).__name__)
