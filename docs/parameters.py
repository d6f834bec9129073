"""Writes the tables of parameters in docs/*.md from the models that read them.

    .venv/bin/python docs/parameters.py

A table stands between `<!-- parameters: NAME -->` and `<!-- end of parameters -->`.
"""

import ast
import inspect
import json
import re
import textwrap
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from schemas.parameters.calibration import CalibrationParameters
from schemas.parameters.scan import ScanParameters
from schemas.parameters.simulation import SimulationSettings

DOCS = Path(__file__).resolve().parent
MARKED = re.compile(r"(<!-- parameters: (\S+) -->\n).*?(<!-- end of parameters -->)", re.DOTALL)

STEPS: dict[str, type[BaseModel]] = {
    name: field.annotation
    for name, field in ScanParameters.model_fields.items()
    if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel)
}
"""The model of each step, by its name in workflow.yaml."""
MODELS: dict[str, type[BaseModel]] = {
    **STEPS,
    "chart": CalibrationParameters,
    "simulation": SimulationSettings,
}
UNITS = {"mm": "mm", "px": "px", "steps": "steps", "frames": "frames"}
"""By the last part of a parameter's name."""
Schema = dict[str, Any]


def main() -> None:
    for page in sorted(DOCS.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        if (current := with_tables(text)) != text:
            page.write_text(current, encoding="utf-8")
            print(f"{page.name}: rewritten")


def with_tables(text: str) -> str:
    """`text` with each of its tables as the models have it now."""
    return MARKED.sub(lambda found: found[1] + table(MODELS[found[2]]) + found[3], text)


def table(model: type[BaseModel]) -> str:
    """All fields of a model: name, unit, default, range, sentence."""
    schema = model.model_json_schema()
    definitions: Schema = schema.get("$defs", {})
    described = sentences(model)
    lines = ["| name | unit | default | range | |", "|---|---|---|---|---|"]
    for name, field in model.model_fields.items():
        content = _resolve(schema["properties"][field.alias or name], definitions)
        sentence = field.description or described.get(name, "")
        default = "required" if field.is_required() else _default(content.get("default"))
        cells = [f"`{name}`", _unit(name, sentence), default, _range(content, definitions), sentence]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def sentences(model: type[BaseModel]) -> dict[str, str]:
    """The text under each field of a class and of those that it is made from, in one line."""
    found: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if not issubclass(base, BaseModel) or base is BaseModel:
            continue
        [definition] = ast.parse(textwrap.dedent(inspect.getsource(base))).body
        assert isinstance(definition, ast.ClassDef)
        for field, text in zip(definition.body, definition.body[1:], strict=False):
            match field, text:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(sentence))):
                    found[name] = " ".join(sentence.split())
    return found


def _resolve(schema: Schema, definitions: Schema) -> Schema:
    """The schema of a field, references followed and None left out."""
    if "anyOf" in schema:
        [chosen] = [part for part in schema["anyOf"] if part.get("type") != "null"]
        schema = {**schema, **chosen}
    if "$ref" in schema:
        schema = {**schema, **definitions[schema["$ref"].rpartition("/")[2]]}
    return schema


def _default(value: Any) -> str:
    return "none" if value is None else f"`{json.dumps(value)}`"


def _unit(name: str, sentence: str) -> str:
    return UNITS.get(name.rpartition("_")[2], "grey levels" if sentence.startswith("grey level") else "")


def _range(schema: Schema, definitions: Schema) -> str:
    schema = _resolve(schema, definitions)
    text = str(schema.get("type", ""))
    match schema:
        case {"enum": values}:
            text = ", ".join(f"`{value}`" for value in values)
        case {"prefixItems": [item, *_] as items}:
            text = f"{len(items)} values, each a {_range(item, definitions)}"
        case {"items": item, "minItems": low, "maxItems": high}:
            text = f"{low} to {high} values, each a {_range(item, definitions)}"
        case {"type": "integer" | "number" as kind}:
            text = _limits("whole number" if kind == "integer" else "number", schema)
        case {"type": "boolean"}:
            text = "`true`, `false`"
        case {"additionalProperties": item}:
            text = f"by name: {_range(item, definitions)}"
    return text


def _limits(kind: str, schema: Schema) -> str:
    words = {"minimum": "from", "exclusiveMinimum": "above", "maximum": "to", "exclusiveMaximum": "below"}
    return " ".join([kind, *(f"{word} {_plain(schema[key])}" for key, word in words.items() if key in schema)])


def _plain(limit: float) -> str:
    return f"{int(limit)}" if float(limit).is_integer() else f"{limit:g}"


if __name__ == "__main__":
    main()
