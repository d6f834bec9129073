"""The tables of parameters and the JSON Schemas in docs/ are those of the models."""

import importlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module", autouse=True)
def _scripts_see_each_other() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(DOCS)
        yield


@pytest.fixture(scope="module")
def parameters(_scripts_see_each_other: None) -> ModuleType:
    return importlib.import_module("parameters")


@pytest.fixture(scope="module")
def json_schemas(_scripts_see_each_other: None) -> ModuleType:
    return importlib.import_module("json_schemas")


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda page: page.name)
def test_tables_are_current(parameters: ModuleType, page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert parameters.with_tables(text) == text, "run docs/parameters.py"


def test_every_step_has_its_table(parameters: ModuleType) -> None:
    text = (DOCS / "workflow.md").read_text(encoding="utf-8")
    for name in parameters.STEPS:
        assert f"<!-- parameters: {name} -->" in text


def test_a_changed_default_is_noticed(parameters: ModuleType) -> None:
    text = (DOCS / "workflow.md").read_text(encoding="utf-8")
    changed = text.replace("| `18` |", "| `19` |", 1)
    assert changed != text
    assert parameters.with_tables(changed) == text


def test_links_lead_somewhere() -> None:
    root = DOCS.parent
    for page in [root / "README.md", *DOCS.glob("*.md"), root / "benchmarks" / "README.md"]:
        for target in page.read_text(encoding="utf-8").split("](")[1:]:
            path = target.split(")")[0].split("#")[0]
            assert not path or "://" in path or (page.parent / path).exists(), f"{page.name}: {path}"


def test_json_schemas_are_current(json_schemas: ModuleType) -> None:
    written = {path.name: path.read_text(encoding="utf-8") for path in (DOCS / "formats").iterdir()}
    assert written == json_schemas.json_schemas(), "run docs/json_schemas.py"


def test_every_document_has_its_json_schema(json_schemas: ModuleType) -> None:
    """Wherever `schemas` names a format, there is the schema of it."""
    named = {
        found
        for module in (DOCS.parent / "schemas").rglob("*.py")
        for found in re.findall(r'format: Literal\["(footscan\.\w+/\d+)"\]', module.read_text(encoding="utf-8"))
    }
    schemas = [json.loads(text) for text in json_schemas.json_schemas().values()]
    assert {schema["properties"]["format"]["const"] for schema in schemas} == named
    assert {"footscan.calibration/1", "footscan.calibration/4", "footscan.workflow/1"} <= named


def test_json_schemas_say_what_fields_mean(json_schemas: ModuleType) -> None:
    calibration = json.loads(json_schemas.json_schemas()["calibration.schema.json"])
    camera = calibration["$defs"]["CameraCalibration"]["properties"]
    assert camera["region_px"]["description"].startswith("Corners of the convex region of pixels")
    assert camera["region_px"]["maxItems"] == 10_000
    assert calibration["properties"]["created"]["description"].startswith("Time of creation; None if")
    assert "format" in calibration["required"]


def test_json_schemas_take_what_we_take(json_schemas: ModuleType) -> None:
    jsonschema = pytest.importorskip("jsonschema", reason="not among our own dependencies")
    written = json_schemas.json_schemas()
    for path in (DOCS.parent / "tests/schemas/frozen").glob("*.json"):
        name = path.stem.removesuffix("-mm").removesuffix("-cm").removesuffix("-4")  # the current one has no number
        schema = json.loads(written[f"{name}.schema.json"])
        validator = jsonschema.Draft202012Validator(schema)
        content = json.loads(path.read_text(encoding="utf-8"))
        validator.check_schema(schema)
        assert list(validator.iter_errors(content)) == []
        assert list(validator.iter_errors(content | {"unit": "inch"})) != []
