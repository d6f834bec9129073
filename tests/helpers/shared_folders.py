"""Folders that take long to make: made once for all workers of a test run; films once for all runs of their code."""

import fcntl
import hashlib
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from pipelines.engine.actions.code import code_identity

Make = Callable[[Path], None]
"""Writes a folder that is not there yet."""
MadeOnce = Callable[[str, Make], Path]
"""A folder by its name, made by the first worker that asks for it; the other workers of the test run share it."""
FILMING = "pipelines.cli.films"
"""The module of `footscan simulate`: it reaches all of the simulator by import."""


def once_a_run(factory: pytest.TempPathFactory) -> MadeOnce:
    """Folders of this test run."""
    root = factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        root = root.parent

    def folder(name: str, make: Make) -> Path:
        with _locked(root / f"{name}.lock"):
            if not (root / name).exists():
                _make(root / name, make)
        return root / name

    return folder


def once_a_code(root: Path) -> MadeOnce:
    """Folders that later test runs take again from `root`, as long as nothing that films or asks for them has changed.

    A folder counts by the digest of its content: one that a test spoiled, or that was cut off, is made anew. Films of
    an older code are deleted.
    """

    def folder(name: str, make: Make) -> Path:
        asked = hashlib.sha256(Path(make.__code__.co_filename).read_bytes()).hexdigest()
        code = hashlib.sha256(f"{code_identity(FILMING).digest} {asked}".encode()).hexdigest()
        films, seal = root / name / code, root / name / f"{code}.sha256"
        with _locked(root / f"{name}.lock"):
            if not (seal.exists() and seal.read_text() == _digest(films)):
                shutil.rmtree(root / name, ignore_errors=True)
                _make(films, make)
                seal.write_text(_digest(films))
        return films

    return folder


@contextmanager
def _locked(file: Path) -> Iterator[None]:
    """Holds back other workers, and other test runs of this checkout."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _make(folder: Path, make: Make) -> None:
    """All of a folder or nothing."""
    unfinished = folder.with_name(f"{folder.name}-unfinished")
    shutil.rmtree(unfinished, ignore_errors=True)
    unfinished.parent.mkdir(parents=True, exist_ok=True)
    make(unfinished)
    unfinished.rename(folder)


def _digest(folder: Path) -> str:
    """SHA-256 over names and content of all files of a folder."""
    digest = hashlib.sha256()
    for file in sorted(path for path in folder.rglob("*") if path.is_file()):
        digest.update(f"{file.relative_to(folder)} {hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()
