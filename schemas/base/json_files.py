"""Reading of the project's JSON documents, with one clear line for each mistake."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from schemas.base.errors import RefusedInput
from schemas.base.limits import read_bounded, refuse_beyond
from schemas.base.mistakes import Mistake, mistakes
from schemas.base.model import AnyDocument


def read_json(path: Path, model: type[AnyDocument]) -> AnyDocument:
    """The JSON file `path` as `model`; RefusedInput where it is missing, too large, no JSON, or breaks the model."""
    return validate(path, model, parse_json(path, read_text(path, "json_bytes")))


def parse_json(source: Path | str, text: str) -> Any:
    """`text` as JSON without NaN, infinities and duplicate names; BeyondLimitError for too many values."""
    refuse_beyond("json_values", text.count(","), source)
    try:
        return encodable(json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_refuse_twice))
    except (ValueError, RecursionError) as error:
        raise RefusedInput(source, f"expected a JSON document ({error})") from None


def validate(
    source: Path | str,
    model: type[AnyDocument],
    value: Any,
    place: Callable[[Mistake], str] | None = None,
) -> AnyDocument:
    """`value` as `model`, or a refusal in one line that names the first wrong field; `place` may add its position."""
    if not isinstance(value, dict):
        raise RefusedInput(source, f"expected a document with named fields, found {_kind(value)}")
    try:
        return model.model_validate(value)
    except ValidationError as error:
        first = mistakes(model, error, most=1)[0]
        field = ".".join(str(name)[:80] for name in first.path) or None
        raise RefusedInput(source, first.problem + (place(first) if place else ""), field=field) from None


def read_text(path: Path, bound: str) -> str:
    """The content of a UTF-8 file; RefusedInput if it is not UTF-8 or larger than the limit named `bound`."""
    try:
        return read_bounded(path, bound).decode("utf-8")
    except UnicodeDecodeError:
        raise RefusedInput(path, "expected UTF-8 text") from None
    except FileNotFoundError:
        raise RefusedInput(path, "no such file") from None
    except (OSError, ValueError) as error:
        raise RefusedInput(path, f"cannot be read ({getattr(error, 'strerror', None) or error})") from None


def encodable(value: Any) -> Any:
    """`value`; ValueError if an escape like \\ud800 has made text that cannot be encoded."""
    json.dumps(value, ensure_ascii=False).encode()
    return value


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON number")


def _refuse_twice(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    names: set[str] = set()
    for name, _ in pairs:
        if name in names:
            raise ValueError(f"{name[:80]!r} is listed twice, expected each name once")
        names.add(name)
    return dict(pairs)


def _kind(value: Any) -> str:
    return {list: "a list", str: "text", type(None): "nothing"}.get(type(value), type(value).__name__)
