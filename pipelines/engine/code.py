"""The identity of a step's code: the syntax trees of all project modules that it reaches by import.

Comments, docstrings and layout do not count. Libraries whose arithmetic it uses count by their versions.
"""

import ast
import gc
import hashlib
import importlib.metadata
import importlib.util
import sys
import threading
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType

ROOMS = ("schemas", "footscan", "pipelines")
"""The project's own packages."""

DISTRIBUTIONS = {
    "PIL": ("pillow",),
    "skimage": ("scikit-image",),
    "yaml": ("PyYAML",),
    "open3d": ("open3d-cpu", "open3d"),
}
"""Distributions that bring a module of another name."""


_PARSING = threading.Lock()
"""With Python 3.11, a thread that builds a syntax tree can fail where another one builds one, or runs code of its own
while the first collects garbage (cpython#106905)."""


@dataclass(frozen=True)
class CodeIdentity:
    """What a module's behaviour depends on."""

    modules: dict[str, str]
    """Digest of the syntax tree of each project module reached, itself included."""
    libraries: dict[str, str]
    """Version of each library imported by one of them."""


def code_identity(module: ModuleType) -> CodeIdentity:
    """The identity of `module` and of everything in this project that it reaches by import."""
    with _PARSING:
        collecting = gc.isenabled()
        gc.disable()
        try:
            return _identity(module)
        finally:
            if collecting:
                gc.enable()


@cache
def _identity(module: ModuleType) -> CodeIdentity:
    modules: dict[str, str] = {}
    libraries: dict[str, str] = {}
    waiting = [module.__name__]
    while waiting:
        name = waiting.pop()
        if name in modules:
            continue
        source = _parse(name)
        modules[name] = source.digest
        for imported in source.imports:
            if imported.split(".")[0] in ROOMS:
                waiting.extend(_with_parents(imported))
            elif imported not in sys.stdlib_module_names:
                libraries[imported] = _version(imported)
    return CodeIdentity(dict(sorted(modules.items())), dict(sorted(libraries.items())))


@dataclass(frozen=True)
class _Source:
    digest: str
    imports: frozenset[str]
    """Project modules by full name, others by the first part of theirs."""


@cache
def _parse(name: str) -> _Source:
    spec = importlib.util.find_spec(name)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(name)
    tree = ast.parse(Path(spec.origin).read_bytes())
    imports = frozenset(_imports(tree))
    for node in ast.walk(tree):
        _drop_docstring(node)
    return _Source(hashlib.sha256(ast.dump(tree).encode()).hexdigest(), imports)


def _imports(tree: ast.Module) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
            # `from package import module` reaches the module, too
            found |= {
                full
                for full in (f"{node.module}.{alias.name}" for alias in node.names)
                if node.module.split(".")[0] in ROOMS and _is_module(full)
            }
    return {name if name.split(".")[0] in ROOMS else name.split(".")[0] for name in found}


def _is_module(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def _with_parents(name: str) -> list[str]:
    """A module and the packages that are imported on the way to it."""
    parts = name.split(".")
    return [".".join(parts[:n]) for n in range(1, len(parts) + 1)]


def _drop_docstring(node: ast.AST) -> None:
    if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
        # A text that stands alone documents what is above it, wherever it stands.
        kept = [s for s in node.body if not (isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant))]
        node.body = kept or [ast.Pass()]


@cache
def _version(module: str) -> str:
    for distribution in DISTRIBUTIONS.get(module, (module,)):
        try:
            return importlib.metadata.version(distribution)
        except importlib.metadata.PackageNotFoundError:
            continue
    raise ModuleNotFoundError(module)
