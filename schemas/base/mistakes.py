"""The mistakes in a document, field by field, each with what was expected."""

import difflib
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from pydantic import BaseModel, ValidationError

Path = tuple[str | int, ...]
MOST = 100
"""Most mistakes that are reported at once; chosen by hand."""
LONGEST_NAME = 80
"""Characters of a name that are compared with the fields' names; a bound of time."""


class Mistake(NamedTuple):
    """One field that breaks its model."""

    path: Path
    """Names and places that lead to it; a missing field's own name is the last."""
    problem: str
    is_name: bool
    """True if the name is wrong, not the value."""


def mistakes(model: type[BaseModel], error: ValidationError, most: int = MOST) -> list[Mistake]:
    """The mistakes that pydantic reports, wrong names first: a misspelt field is also missing, but its name tells more.

    At most `most` of them, because the search for the intended name takes time.
    """
    found = sorted(error.errors(include_url=False), key=lambda e: e["type"] != "extra_forbidden")
    return [Mistake(tuple(e["loc"]), _problem(model, dict(e)), e["type"] == "extra_forbidden") for e in found[:most]]


def nearest_name(model: type[BaseModel], path: Path) -> str | None:
    """The field that `path` probably means: one of the same section, or else one of any section, with that section."""
    name = str(path[-1])[:LONGEST_NAME]
    here = sorted({field for section in _sections(model, path[:-1]) for field in _fields(section)})
    if near := difflib.get_close_matches(name, here, n=1):
        return near[0]
    by_depth = sorted(_all_fields(model), key=lambda found: -len(found[0]))  # of several places the shallowest
    places = {name: ".".join((*place, name)) for place, name in by_depth}
    near = difflib.get_close_matches(name, sorted(places), n=1)
    return places[near[0]] if near else None


def _problem(model: type[BaseModel], error: dict[str, Any]) -> str:
    if error["type"] == "extra_forbidden":
        near = nearest_name(model, tuple(error["loc"]))
        return "unknown field" + (f", did you mean {near!r}?" if near else "")
    if error["type"] == "missing":
        return "is missing, expected a value"
    if error["type"] == "model_type":  # pydantic's message names a class of the project
        return f"expected fields with values, found {str(error.get('input'))[:80]!r}"
    message = str(error["msg"]).removeprefix("Value error, ")
    message = f"{message[0].lower()}{message[1:]}"
    found = error.get("input")
    if not (isinstance(found, str | int | float | bool) or found is None):
        return message
    return f"{message}, found {str(found)[:80]!r}{_hint(error, str(found))}"


def _hint(error: dict[str, Any], found: str) -> str:
    if error["type"] == "literal_error":
        allowed = re.findall(r"'([^']*)'", str(error["ctx"]["expected"]))
        near = difflib.get_close_matches(found, allowed, n=1)
        return f", did you mean {near[0]!r}?" if near else ""
    if error["type"] in {"float_parsing", "int_parsing"}:
        if re.fullmatch(r"[-+]?\d+,\d+", found):
            return ": the decimal mark is a point"
        if re.fullmatch(r"[-+]?[\d.]+\s*[^\d\s.]+", found):
            return ": a number stands without a unit"
    return ""


def _sections(model: type[BaseModel], path: Path) -> list[type[BaseModel]]:
    """The models that `path` may lead to; it also holds the tag of a field that takes one of several models."""
    sections = [model]
    for part in path:
        holders = [_fields(section)[str(part)] for section in sections if part in _fields(section)]
        sections = [inner for holder in holders for inner in _models_in(holder)] if holders else sections
    return sections


def _all_fields(model: type[BaseModel], place: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], str]]:
    """Every field in `model` and in the models that it holds, each after the names that lead to it."""
    for name, annotation in _fields(model).items():
        yield place, name
        for part in _models_in(annotation):
            if len(place) < 8:  # a model may hold itself
                yield from _all_fields(part, (*place, name))


def _fields(model: type[BaseModel]) -> dict[str, Any]:
    return {field.alias or name: field.annotation for name, field in model.model_fields.items()}


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in getattr(annotation, "__args__", ()) for model in _models_in(part)]
