"""Fixtures for steps of generated modules, in a package that the engine counts as part of the project."""

import importlib
import itertools
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from pipelines.engine.actions import code
from pipelines.engine.actions.step import Outcome, Step
from pipelines.engine.plan import make_plan
from pipelines.engine.pool import StepEnd, Threads
from pipelines.engine.run import run_plan
from pipelines.engine.store.store import Store, open_store

PACKAGES = itertools.count()

JOIN = """
def run(inputs, parameters, places):
    text = b"+".join(inputs[name] for name in sorted(inputs))
    return text if parameters is None else text + b"*" + str(parameters.factor).encode()
"""


class MadeUpPackage:
    """A package whose modules a test writes and rewrites."""

    def __init__(self, folder: Path) -> None:
        self.name = f"made_up_{next(PACKAGES)}"
        self.folder = folder / self.name
        self.folder.mkdir(parents=True)
        self.write("__init__", '"""Made up."""')

    def write(self, module: str, source: str) -> None:
        path = self.folder / Path(*module.split(".")).with_suffix(".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(source.replace("PACKAGE", self.name))

    def load(self, module: str) -> str:
        """The name of the module, which is imported as in a new process."""
        self.forget()
        return f"{self.name}.{module}"

    def forget(self) -> None:
        for name in [name for name in sys.modules if name.split(".")[0] == self.name]:
            del sys.modules[name]
        importlib.invalidate_caches()
        code._IDENTITIES.clear()
        code._source.cache_clear()

    def step_module(self, name: str, source: str = JOIN) -> str:
        self.write(name, source)
        return self.load(name)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[MadeUpPackage]:
    made_up = MadeUpPackage(tmp_path / "code")
    monkeypatch.syspath_prepend(tmp_path / "code")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(code, "ROOMS", (*code.ROOMS, made_up.name))
    yield made_up
    made_up.forget()


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return open_store(tmp_path / "store", tmp_path / "known.sqlite")


RunSteps = Callable[..., tuple[dict[str, Outcome], list[str]]]


@pytest.fixture
def run_steps(store: Store) -> RunSteps:
    """Plan and run steps; returns their outcomes by kind, and the kinds that ran."""

    def run(*steps: Step, workers: int = 2) -> tuple[dict[str, Outcome], list[str]]:
        ends: list[StepEnd] = []
        outcomes = run_plan(make_plan(steps, store), store, pool=Threads(workers), on_step_end=ends.append)
        assert sorted(outcomes) == sorted(step.name for step in steps)
        assert len({end.step.name for end in ends}) == len(ends)
        return {step.kind: outcomes[step.name] for step in steps}, sorted(end.step.kind for end in ends if end.ran)

    return run
