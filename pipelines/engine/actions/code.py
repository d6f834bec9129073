"""The identity of a step's code: the syntax trees of all project modules that it reaches by import.

Comments, docstrings and layout do not count. Libraries whose arithmetic it uses count by their versions, and so does
Python's own.
"""

import ast
import contextlib
import gc
import importlib.util
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from pipelines.engine.actions.libraries import versions_that_count
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.digest import FileState, file_state, is_settled, sha256
from pipelines.engine.files.seal import BROKEN, sealed, unsealed
from schemas.base.errors import Fault
from schemas.base.model import canonical_json

OWN = ROOMS = ("schemas", "footscan", "pipelines")
"""The project's own packages."""
MEMORY = Path(__file__).parent / "__pycache__" / f"code.{sys.implementation.cache_tag}.json"

_PARSING = threading.Lock()
"""With Python 3.11, a thread that builds a syntax tree can fail where another one builds one, or runs code of its own
while the first collects garbage (cpython#106905)."""


@dataclass(frozen=True)
class CodeIdentity:
    """What a module's behaviour depends on."""

    modules: dict[str, str]
    """Digest of the syntax tree of each project module reached, itself included."""
    libraries: dict[str, str]
    """Version of each library whose arithmetic one of them can use, and of Python."""

    @cached_property
    def document(self) -> bytes:
        """All of it, as canonical JSON."""
        return canonical_json({"modules": self.modules, "libraries": self.libraries}).encode()

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the document."""
        return sha256(self.document)


def code_identity(module: str) -> CodeIdentity:
    """The identity of the module of this name and of everything in this project that it reaches by import."""
    known = _KNOWN.get(module)
    if known is not None:
        return known
    with _parsing():
        identity = _KNOWN[module] = _identity(module)
        _remember()
    return identity


def code_text(module: str) -> bytes:
    """The syntax tree of a project module without docstrings, as Python writes it down: its digest is that of this."""
    with _parsing():
        return _text(module, file_state(_file(module))).encode()


_KNOWN: dict[str, CodeIdentity] = {}


@contextmanager
def _parsing() -> Iterator[None]:
    with _PARSING:
        collecting = gc.isenabled()
        gc.disable()
        try:
            yield
        finally:
            if collecting:
                gc.enable()


def _identity(module: str) -> CodeIdentity:
    modules: dict[str, str] = {}
    libraries = {"python": ".".join(map(str, sys.version_info[:2]))}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in modules:
            continue
        source = _source(name)
        modules[name] = source.digest
        for imported in source.imports:
            if imported.split(".")[0] in ROOMS:
                waiting.extend(_with_parents(imported))
            elif imported not in sys.stdlib_module_names:
                libraries |= versions_that_count(imported)
    return CodeIdentity(dict(sorted(modules.items())), dict(sorted(libraries.items())))


@dataclass(frozen=True)
class _Source:
    digest: str
    """Of the text."""
    imports: frozenset[str]
    """Project modules by full name, others by the first part of theirs."""


@cache
def _source(name: str) -> _Source:
    state = file_state(_file(name))
    known = _remembered().get(name)
    if known is not None and known[0] == list(state):
        return _Source(known[1], frozenset(known[2]))
    source = _Source(sha256(_text(name, state).encode()), frozenset(_imports(_tree(name))))
    if name.split(".", maxsplit=1)[0] in OWN and is_settled(state):
        _remembered()[name] = [list(state), source.digest, sorted(source.imports)]
        _CHANGED.add(name)
    return source


@cache
def _remembered() -> dict[str, list[Any]]:
    """What is known of modules that have not been touched since: their states, digests and imports."""
    try:
        return dict(unsealed(MEMORY.read_bytes())["modules"])
    except (OSError, *BROKEN):
        return {}


_CHANGED: set[str] = set()


def _remember() -> None:
    if _CHANGED:
        _CHANGED.clear()
        with contextlib.suppress(Fault):
            write_atomically(MEMORY, sealed({"modules": _remembered()}))


@cache
def _text(name: str, _: FileState) -> str:
    """The syntax tree of a module without docstrings, as Python writes it down, in a state of its file."""
    tree = _tree(name)
    for node in ast.walk(tree):
        _drop_docstring(node)
    return ast.unparse(tree)


def _tree(name: str) -> ast.Module:
    return ast.parse(_file(name).read_bytes())


def _file(name: str) -> Path:
    spec = importlib.util.find_spec(name)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(name)
    return Path(spec.origin)


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
