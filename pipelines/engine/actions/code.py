"""The identity of a step's code: the syntax trees of all project modules that it reaches by import.

Comments, docstrings and layout do not count. Libraries whose arithmetic it uses count by their versions; Python counts
by its own.
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

from footscan.syntax_lock import SYNTAX_LOCK
from pipelines.engine.actions.libraries import versions_that_count
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.digest import FileState, file_state, is_settled, sha256
from pipelines.engine.files.seal import UNSEALING_ERRORS, sealed, unsealed
from schemas.base.errors import Fault
from schemas.base.model import canonical_json

ROOMS = ("schemas", "footscan", "pipelines")
"""The packages of this project."""
MEMORY = Path(__file__).parent / "__pycache__" / f"code.{sys.implementation.cache_tag}.json"
"""File that remembers the digests and imports of modules between processes."""
TEXTS = MEMORY.with_name(f"code_texts.{sys.implementation.cache_tag}.json")
"""File that remembers their texts by their digests: a new store needs all of them, and to make them takes a second."""

_PARSING = threading.Lock()
"""Lock for building syntax trees. With Python 3.11 a thread that builds one can fail if another thread builds one too,
or runs other code while the first collects garbage (cpython#106905)."""


@dataclass(frozen=True)
class CodeIdentity:
    """All code that a module's behaviour depends on."""

    modules: dict[str, str]
    """Digest of the syntax tree of each project module that it reaches, itself included."""
    libraries: dict[str, str]
    """Version of each library whose arithmetic these modules can use, and of Python."""

    @cached_property
    def document(self) -> bytes:
        """Modules and libraries as canonical JSON."""
        return canonical_json({"modules": self.modules, "libraries": self.libraries}).encode()

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the document."""
        return sha256(self.document)


def code_identity(module: str) -> CodeIdentity:
    """Return the identity of a module and of all project modules that it reaches by import."""
    identity = _IDENTITIES.get(module)
    if identity is not None:
        return identity
    with _parsing():
        identity = _IDENTITIES[module] = _identity(module)
        _save_memory()
    return identity


def code_text(module: str) -> bytes:
    """Return the source text of a module's syntax tree, without docstrings; its digest is that of this text."""
    with _parsing():
        text = _remembered_texts().get(_source(module).digest) or _text(module, file_state(_file(module)))
        return text.encode()


_IDENTITIES: dict[str, CodeIdentity] = {}


@contextmanager
def _parsing() -> Iterator[None]:
    with _PARSING:
        was_on = gc.isenabled()
        gc.disable()
        try:
            yield
        finally:
            if was_on:
                gc.enable()


def _identity(module: str) -> CodeIdentity:
    modules: dict[str, str] = {}
    libraries = {"python": ".".join(map(str, sys.version_info[:2]))}
    pending = [module]
    while pending:
        name = pending.pop()
        if name in modules:
            continue
        source = _source(name)
        modules[name] = source.digest
        for imported in source.imports:
            if imported.split(".")[0] in ROOMS:
                pending.extend(_with_parents(imported))
            elif imported not in sys.stdlib_module_names:
                libraries |= versions_that_count(imported)
    return CodeIdentity(dict(sorted(modules.items())), dict(sorted(libraries.items())))


@dataclass(frozen=True)
class _Source:
    digest: str
    """Digest of the text."""
    imports: frozenset[str]
    """Imported modules: those of the project by full name, others by the first part of the name."""


@cache
def _source(name: str) -> _Source:
    state = file_state(_file(name))
    remembered = _remembered().get(name)
    if remembered is not None and remembered[0] == list(state):
        return _Source(remembered[1], frozenset(remembered[2]))
    text = _text(name, state)
    source = _Source(sha256(text.encode()), frozenset(_imports(_tree(name))))
    if name.split(".", maxsplit=1)[0] in ROOMS and is_settled(state):
        _remembered()[name] = [list(state), source.digest, sorted(source.imports)]
        _remembered_texts()[source.digest] = text
        _CHANGED.add(name)
    return source


@cache
def _remembered() -> dict[str, list[Any]]:
    """Read state, digest and imports of each module from `MEMORY`; an entry is valid while the state is the same.

    Nothing is remembered where `TEXTS` is missing, so that both files are written again.
    """
    if not TEXTS.exists():
        return {}
    try:
        return dict(unsealed(MEMORY.read_bytes())["modules"])
    except (OSError, *UNSEALING_ERRORS):
        return {}


@cache
def _remembered_texts() -> dict[str, str]:
    """Read the texts of modules by their digests from `TEXTS`."""
    try:
        return dict(unsealed(TEXTS.read_bytes())["texts"])
    except (OSError, *UNSEALING_ERRORS):
        return {}


_CHANGED: set[str] = set()


def _save_memory() -> None:
    if _CHANGED:
        _CHANGED.clear()
        used = {digest for _, digest, _ in _remembered().values()}
        texts = {digest: text for digest, text in _remembered_texts().items() if digest in used}
        with contextlib.suppress(Fault):
            write_atomically(MEMORY, sealed({"modules": _remembered()}))
            write_atomically(TEXTS, sealed({"texts": texts}))


@cache
def _text(name: str, _: FileState) -> str:
    """Source text of the syntax tree of a module without docstrings, for one state of its file."""
    tree = _tree(name)
    for node in ast.walk(tree):
        _drop_docstring(node)
    return ast.unparse(tree)


def _tree(name: str) -> ast.Module:
    with SYNTAX_LOCK:
        return ast.parse(_file(name).read_bytes())


def _file(name: str) -> Path:
    spec = importlib.util.find_spec(name)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(name)
    return Path(spec.origin)


def _imports(tree: ast.Module) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            # `from package import module` reaches the module, too
            names |= {
                full
                for full in (f"{node.module}.{alias.name}" for alias in node.names)
                if node.module.split(".")[0] in ROOMS and _is_module(full)
            }
    return {name if name.split(".")[0] in ROOMS else name.split(".")[0] for name in names}


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
        # A string expression documents the statement above it, so it counts as a docstring everywhere.
        kept = [s for s in node.body if not (isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant))]
        node.body = kept or [ast.Pass()]
