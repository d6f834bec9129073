"""A new release of a library: what an archive that is done has to run again."""

import importlib.metadata
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from pipelines.engine.actions import code, libraries

Release = Callable[[str], None]


@pytest.fixture
def release(monkeypatch: pytest.MonkeyPatch) -> Iterator[Release]:
    """Puts a patch release of a distribution before the one that is installed."""
    installed = importlib.metadata.version

    def forget() -> None:
        libraries._version.cache_clear()
        code._KNOWN.clear()

    def released(distribution: str) -> None:
        def version(name: str) -> str:
            return installed(name) + ".1" * (name.lower() == distribution.lower())

        monkeypatch.setattr(importlib.metadata, "version", version)
        forget()

    yield released
    monkeypatch.undo()
    forget()


@pytest.mark.parametrize("distribution", ["PyYAML", "zarr", "dask", "distributed", "pydantic", "matplotlib", "typer"])
def test_what_computes_nothing_costs_nothing(done: Any, release: Release, distribution: str) -> None:
    release(distribution)
    assert done.plan()[1] == {}


def test_a_decoder_costs_what_it_decodes(done: Any, release: Release) -> None:
    release("av")
    assert {name for name, reason in done.plan()[1].items() if "av" in reason} == {"ingest-1", "ingest-5"}
    assert done.run()[1] == {"ingest-1", "ingest-5"}  # they come to the same, so that nothing behind them runs


def test_numpy_costs_all(done: Any, release: Release) -> None:
    release("numpy")
    steps, reasons = done.plan()
    assert len(reasons) == steps


def test_a_library_that_is_used_by_another_counts(done: Any, release: Release) -> None:
    release("llvmlite")
    reasons = done.plan()[1]
    assert "llvmlite" in reasons["extract-1"]
