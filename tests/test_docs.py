"""The tables of parameters in docs/ are those of the models."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def parameters() -> ModuleType:
    spec = importlib.util.spec_from_file_location("docs_parameters", DOCS / "parameters.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


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
