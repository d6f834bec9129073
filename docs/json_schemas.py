"""Writes docs/formats/*.schema.json, the JSON Schema of every document, from the models that read it.

    .venv/bin/python docs/json_schemas.py

The current version of a document is `<name>.schema.json`, a former one `<name>-<version>.schema.json`.
"""

import importlib
import json
import pkgutil
from pathlib import Path
from typing import Any

from parameters import sentences  # the script beside this one

import schemas
from schemas.base.model import Document

FOLDER = Path(__file__).resolve().parent / "formats"
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def main() -> None:
    current = json_schemas()
    for path in sorted(FOLDER.glob("*")):
        if path.name not in current:
            path.unlink()
            print(f"{path.name}: removed")
    FOLDER.mkdir(exist_ok=True)
    for name, text in current.items():
        path = FOLDER / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(f"{name}: written")


def json_schemas() -> dict[str, str]:
    """The content of every file, by its name."""
    models = _all_models()
    public = [model for model in models.values() if not model.__name__.startswith("_")]
    documents = {_format(model): model for model in public if "format" in model.model_fields}
    newest = {name: max(version for other, version in documents if other == name) for name, _ in documents}
    return {
        f"{name}.schema.json" if version == newest[name] else f"{name}-{version}.schema.json": _text(model, models)
        for (name, version), model in sorted(documents.items())
    }


def _all_models() -> dict[str, type[Document]]:
    """Every model in the package `schemas`, by the name of its class."""
    models: dict[str, type[Document]] = {}
    for module in pkgutil.walk_packages(schemas.__path__, "schemas."):
        for value in vars(importlib.import_module(module.name)).values():
            if isinstance(value, type) and issubclass(value, Document) and value is not Document:
                assert models.setdefault(value.__name__, value) is value, f"two models are called {value.__name__}"
    return models


def _format(model: type[Document]) -> tuple[str, int]:
    """Name and version, from `footscan.<name>/<version>`."""
    name, _, version = model.model_json_schema()["properties"]["format"]["const"].partition("/")
    return name.removeprefix("footscan."), int(version)


def _text(model: type[Document], models: dict[str, type[Document]]) -> str:
    schema = model.model_json_schema()
    schema["required"] = sorted({"format", *schema.get("required", [])})  # without it nothing is read
    parts: dict[str, dict[str, Any]] = {model.__name__: schema, **schema.get("$defs", {})}
    for name, part in parts.items():
        for field, sentence in sentences(models[name]).items():
            part["properties"][field].setdefault("description", sentence)
    return json.dumps({"$schema": DIALECT, **schema}, indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    main()
