"""The YAML that the project reads: lists and named values, whose scalars stay text; and the position of each."""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import yaml

MAX_DEPTH = 24
"""Most levels of nesting, a bound of the stack; chosen by hand."""
NOTHING = {"", "~", "null"}
"""Scalars that mean no value unless they are in quotes."""
_PARSER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The parser of libyaml if PyYAML was built with it, for speed: an archive has a document for each scan."""
_Events = Iterator[Any]
"""Events of PyYAML, which has no types."""


def parse_yaml(text: str) -> Any:
    """The only document of `text`, or None if it is empty. ValueError says in one line what is wrong, and where.

    Scalars stay the text that was written; the model gives them their type: YAML would read `no` as false, `2026-11-20`
    as a date, `0123` as 83 and `1e3` as text. Features of YAML beyond lists and named values are refused: aliases,
    tags, deep nesting.
    """
    try:
        try:
            return _document(yaml.parse(text, Loader=_PARSER))
        except (yaml.YAMLError, ValueError):  # PyYAML's own parser accepts a little more and has better messages
            return _document(yaml.parse(text, Loader=yaml.SafeLoader))
    except yaml.MarkedYAMLError as error:
        mark: Any = error.problem_mark
        where = "" if mark is None else f"line {mark.line + 1}, column {mark.column + 1}: "
        problem = error.problem or error.context or ""
        raise ValueError(f"{where}{problem}{'' if 'expected' in problem else ', expected YAML'}") from None
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise ValueError(f"expected YAML ({error})") from None


def place_in_yaml(text: str, path: Sequence[str | int], *, of_name: bool = False) -> tuple[int, int]:
    """Line and column, from 1, of the value that `path` leads to in a `text` that parses, or of its last known part.

    Parameters
    ----------
    of_name : bool
        True for the position of the value's name, which is always used for a section.
    """
    node = name = _composed(text)
    for part in path:
        if isinstance(node, yaml.MappingNode):
            found = next(((key, value) for key, value in node.value if key.value == str(part)), None)
            if found is not None:
                name, node = found
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            name = node = node.value[part]
    mark = (name if of_name or isinstance(node, yaml.MappingNode) else node).start_mark
    return mark.line + 1, mark.column + 1


@lru_cache(maxsize=2)
def _composed(text: str) -> Any:
    """The nodes of a `text` that parses, cached because each of its mistakes needs them."""
    try:
        return yaml.compose(text, Loader=_PARSER)
    except yaml.YAMLError:  # only one of the parsers accepts it, see `parse_yaml`
        return yaml.compose(text, Loader=yaml.SafeLoader)


def _document(events: _Events) -> Any:
    next(events)  # the start of the stream
    if isinstance(next(events), yaml.StreamEndEvent):
        return None
    value = _value(next(events), events, 1)
    next(events)  # the end of the document
    if not isinstance(more := next(events), yaml.StreamEndEvent):
        raise _refusal("expected a single document", more)
    return value


def _value(event: Any, events: _Events, depth: int) -> Any:
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
        return [_value(part, events, depth + 1) for part in _until(yaml.SequenceEndEvent, events)]
    values: dict[str, Any] = {}
    for key in _until(yaml.MappingEndEvent, events):
        name = _value(key, events, depth + 1)
        if not isinstance(name, str):
            raise _refusal("expected a name before ':'", key)
        if name in values:
            raise _refusal(f"{name[:80]!r} is listed twice, expected each name once", key)
        values[name] = _value(next(events), events, depth + 1)
    return values


def _until(end: type, events: _Events) -> _Events:
    while not isinstance(event := next(events), end):
        yield event


def _refusal(problem: str, where: Any) -> yaml.MarkedYAMLError:
    """`where` : the event that is refused."""
    return yaml.MarkedYAMLError(problem=problem, problem_mark=where.start_mark)
