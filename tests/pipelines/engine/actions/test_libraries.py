"""Libraries in a key: those that compute, and none that only carries values."""

import ast
import sys
from pathlib import Path

import pytest

from pipelines.engine.actions.code import ROOMS, code_identity
from pipelines.engine.actions.libraries import CARRYING, COMPUTING, versions_that_count

PROJECT = Path(__file__).parents[4]
STEPS = sorted(file.stem for file in (PROJECT / "pipelines" / "steps").glob("*.py") if file.stem != "__init__")


def imported_libraries() -> set[str]:
    """First parts of the names of all libraries that a module of the project imports."""
    names: set[str] = set()
    for room in ROOMS:
        for file in (PROJECT / room).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_bytes())):
                if isinstance(node, ast.Import):
                    names |= {alias.name.split(".")[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                    names.add(node.module.split(".")[0])
    return names - set(ROOMS) - sys.stdlib_module_names


def test_every_library_has_one_class() -> None:
    unclassified = sorted(imported_libraries() - COMPUTING - CARRYING)
    assert not unclassified, f"add to COMPUTING or CARRYING of pipelines/engine/actions/libraries.py: {unclassified}"
    assert not COMPUTING & CARRYING


def test_library_in_no_class_counts() -> None:
    assert "pytest" not in COMPUTING | CARRYING
    assert versions_that_count("pytest") == {"pytest": pytest.__version__}


@pytest.mark.parametrize("step", STEPS)
def test_keys_of_steps_hold_computing_libraries_only(step: str) -> None:
    found = set(code_identity(f"pipelines.steps.{step}").libraries)
    assert found <= COMPUTING | {"python"}
    assert ("numba" in found) == ("llvmlite" in found)
