"""Reading and writing of the project's YAML and JSON documents, as pydantic models, with one clear line per mistake."""

import difflib
import json
import re
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, TypeVar

import yaml
from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError

from schemas.errors import RefusedInput

MAX_BYTES = 8 * 2**20
MAX_DEPTH = 24


def _pseudonym(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,64}", name):
        raise ValueError("expected 1 to 64 letters, digits, '-' and '_'")
    return name


Pseudonym = Annotated[str, AfterValidator(_pseudonym)]
"""A name that may become a folder: letters, digits, '-' and '_', 1 to 64 of them."""


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
    return validate(path, model, _parse_yaml(path, read_text(path)))


def read_json(path: Path, model: type[AnyDocument]) -> AnyDocument:
    """The JSON file `path` as `model`; errors as in `read_yaml`."""
    return validate(path, model, parse_json(path, read_text(path)))


def parse_json(source: Path | str, text: str) -> Any:
    """`text` as JSON without NaN, infinities and names that stand twice."""
    try:
        return _encodable(json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_refuse_twice))
    except (ValueError, RecursionError) as error:
        raise RefusedInput(source, f"expected a JSON document ({error})") from None


def canonical_json(value: Any) -> str:
    """JSON that is the same for equal values: sorted keys, no spaces, no NaN."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)


def validate(source: Path | str, model: type[AnyDocument], value: Any) -> AnyDocument:
    """`value` as `model`, or one line that names the first wrong field."""
    if not isinstance(value, dict):
        raise RefusedInput(source, f"expected a document with named fields, found {_kind(value)}")
    try:
        return model.model_validate(value)
    except ValidationError as error:
        errors = error.errors(include_url=False)
        # A misspelt field is missing, too: its own name says more.
        first = next((e for e in errors if e["type"] == "extra_forbidden"), errors[0])
        field = ".".join(str(part) for part in first["loc"]) or None
        raise RefusedInput(source, _expectation(model, dict(first)), field=field) from None


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


def _expectation(model: type[BaseModel], error: dict[str, Any]) -> str:
    message = str(error["msg"]).removeprefix("Value error, ")
    if error["type"] == "extra_forbidden":
        known = sorted(_field_names(model))
        near = difflib.get_close_matches(str(error["loc"][-1]), known, n=1)
        return "unknown field" + (f", did you mean {near[0]!r}?" if near else "")
    if error["type"] == "missing":
        return "is missing, expected a value"
    found = error.get("input")
    if isinstance(found, str | int | float | bool) or found is None:
        return f"{message[0].lower()}{message[1:]}, found {str(found)[:80]!r}"
    return f"{message[0].lower()}{message[1:]}"


def _field_names(model: type[BaseModel], seen: set[type[BaseModel]] | None = None) -> set[str]:
    """Names of all fields in `model` and in the models that it holds."""
    seen = set() if seen is None else seen
    if model in seen:
        return set()
    seen.add(model)
    names: set[str] = set()
    for name, field in model.model_fields.items():
        names.add(field.alias or name)
        for part in _models_in(field.annotation):
            names |= _field_names(part, seen)
    return names


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in getattr(annotation, "__args__", ()) for model in _models_in(part)]


def read_text(path: Path) -> str:
    """The content of a small UTF-8 file; RefusedInput where it is none."""
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise RefusedInput(path, "expected a file")
        if status.st_size > MAX_BYTES:
            raise RefusedInput(path, f"larger than {MAX_BYTES} bytes, expected a small text document")
        return path.read_bytes().decode("utf-8")
    except UnicodeDecodeError:
        raise RefusedInput(path, "expected UTF-8 text") from None
    except FileNotFoundError:
        raise RefusedInput(path, "no such file") from None
    except (OSError, ValueError) as error:
        raise RefusedInput(path, f"cannot be read ({getattr(error, 'strerror', None) or error})") from None


def _parse_yaml(path: Path, text: str) -> Any:
    try:
        try:
            return _encodable(_yaml_document(yaml.parse(text, Loader=_PARSER)))
        except (yaml.YAMLError, ValueError):  # PyYAML's own parser takes a little more, and says better what is wrong
            return _encodable(_yaml_document(yaml.parse(text, Loader=yaml.SafeLoader)))
    except yaml.MarkedYAMLError as error:
        mark: Any = error.problem_mark
        where = "" if mark is None else f"line {mark.line + 1}, column {mark.column + 1}: "
        problem = error.problem or error.context or ""
        raise RefusedInput(path, f"{where}{problem}{'' if 'expected' in problem else ', expected YAML'}") from None
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise RefusedInput(path, f"expected YAML ({error})") from None


_PARSER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Of libyaml where PyYAML was built with it: an archive has a document for each scan."""
_Events = Iterator[Any]
"""PyYAML's, which have no types."""


def _yaml_document(events: _Events) -> Any:
    """The only document among the events of a parser; None where there is none.

    Scalars stay the text that was written; the model gives them their type: YAML would read `no` as false, `2026-11-20`
    as a date, `0123` as 83 and `1e3` as text. What makes YAML more than lists and named values is refused: aliases,
    tags, deep nesting.
    """
    next(events)  # the start of the stream
    if isinstance(next(events), yaml.StreamEndEvent):
        return None
    value = _yaml_value(next(events), events, 1)
    next(events)  # the end of the document
    if not isinstance(more := next(events), yaml.StreamEndEvent):
        raise _refusal("expected a single document", more)
    return value


def _yaml_value(event: Any, events: _Events, depth: int) -> Any:
    if isinstance(event, yaml.AliasEvent):
        raise _refusal(f"alias {str(event.anchor)[:80]!r}, expected it written out", event)
    if event.tag is not None:
        raise _refusal(f"tag {event.tag[:80]!r}, expected none", event)
    if depth > MAX_DEPTH:
        raise _refusal(f"expected at most {MAX_DEPTH} levels", event)
    if isinstance(event, yaml.ScalarEvent):
        is_plain: bool = event.implicit[0]
        return None if is_plain and event.value in NOTHING else event.value
    if isinstance(event, yaml.SequenceStartEvent):
        return [_yaml_value(part, events, depth + 1) for part in _until(yaml.SequenceEndEvent, events)]
    values: dict[str, Any] = {}
    for key in _until(yaml.MappingEndEvent, events):
        name = _yaml_value(key, events, depth + 1)
        if not isinstance(name, str):
            raise _refusal("expected a name before ':'", key)
        if name in values:
            raise _refusal(f"{name[:80]!r} stands twice, expected each name once", key)
        values[name] = _yaml_value(next(events), events, depth + 1)
    return values


def _until(end: type, events: _Events) -> _Events:
    while not isinstance(event := next(events), end):
        yield event


NOTHING = {"", "~", "null"}
"""What stands for no value where it is not in quotes."""


def _refusal(problem: str, where: Any) -> yaml.MarkedYAMLError:
    """`where` : the event that is refused."""
    return yaml.MarkedYAMLError(problem=problem, problem_mark=where.start_mark)


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
