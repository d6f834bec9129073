"""The virtual scanner judges the reconstruction: they share the formats of files, and nothing else."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[3]
VIRTUAL = ROOT / "footscan" / "virtual"
OF_THE_VIRTUAL_SCANNER = {"schemas.parameters.simulation", "schemas.world"}
"""Documents that the reconstruction must not know: they say what is simulated."""
OF_THE_RECONSTRUCTION = re.compile(r"schemas\.(parameters\.(?!simulation)|quality|fusion|tuning)")
"""Documents that the virtual scanner must not know: they say what is assumed."""
FACTS = {
    "CONTACT_MM",  # the height up to which a sole touches the floor, in the definition of the arch index
}
"""Constants of definitions, standards and physics, which both may state."""


def modules(of_virtual: bool) -> Iterator[tuple[str, ast.Module]]:
    for file in sorted((ROOT / "footscan").rglob("*.py")):
        if file.is_relative_to(VIRTUAL) == of_virtual:
            yield file.relative_to(ROOT).as_posix(), ast.parse(file.read_text(encoding="utf-8"))


def imported(tree: ast.Module) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            names.add(node.module)
    return names


def constants(of_virtual: bool) -> dict[str, set[float]]:
    """Values of the module-level numbers that are neither whole and small nor powers of ten, by name."""
    found: dict[str, set[float]] = {}
    for _, tree in modules(of_virtual):
        for node in tree.body:
            if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant):
                value, target = node.value.value, node.targets[0]
                if isinstance(target, ast.Name) and isinstance(value, int | float):
                    found.setdefault(target.id.lstrip("_"), set()).add(float(value))
    return found


def test_neither_knows_the_documents_of_the_other() -> None:
    told = [(name, one) for name, tree in modules(False) for one in imported(tree) if one in OF_THE_VIRTUAL_SCANNER]
    told += [(name, one) for name, tree in modules(True) for one in imported(tree) if OF_THE_RECONSTRUCTION.match(one)]
    assert told == []


def test_no_constant_stands_on_both_sides() -> None:
    ours, theirs = constants(True), constants(False)
    shared = {name for name in ours.keys() & theirs.keys() if ours[name] & theirs[name]}
    assert shared - FACTS == set()
