"""A new release of a library: the steps of a finished archive that run again."""

import importlib.metadata
import json
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from pipelines.arrays import pack, unpack
from pipelines.cli.main import run_command
from pipelines.engine.actions import code, libraries
from pipelines.steps import clean

Release = Callable[[str], None]


@pytest.fixture
def release(monkeypatch: pytest.MonkeyPatch) -> Iterator[Release]:
    """Puts a patch release of a distribution before the one that is installed."""
    installed = importlib.metadata.version

    def forget() -> None:
        libraries._version.cache_clear()
        code._IDENTITIES.clear()

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


@pytest.fixture
def upgrade(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Exit status and what `footscan cache upgrade ARGUMENTS` prints."""

    def run(*arguments: object) -> tuple[int, str, str]:
        capsys.readouterr()
        status = run_command(["cache", "upgrade", *map(str, arguments)])
        output = capsys.readouterr()
        return status, output.out, output.err

    return run


def test_an_upgrade_that_changes_nothing_is_accepted_after_a_sample(
    done: Any, release: Release, upgrade: Callable[..., tuple[int, str, str]], capsys: pytest.CaptureFixture[str]
) -> None:
    release("numpy")
    status, out, _ = upgrade(done.workflow, "--sample", 1, "--json")
    found = json.loads(out)
    assert (status, found["accepted"]) == (0, None)
    assert {(one["sample"], one["agrees"]) for one in found["steps"]} == {(1, True)}
    version = importlib.metadata.version("numpy")
    assert all(f"numpy {version.removesuffix('.1')} -> {version}" in one["changes"] for one in found["steps"])
    steps, reasons = done.plan()
    assert len(reasons) == steps  # nothing was accepted yet
    stale = steps - 2  # quality.json and sizes.json compute without numpy

    status, out, _ = upgrade(done.workflow, "--sample", 1, "--accept", "release notes name no change of arithmetic")
    assert (status, out.splitlines()[-1]) == (0, f"{stale} results accepted under the new version")
    assert done.plan()[1] == {}
    assert run_command(["trace", str(done.results / "foot.stl"), "--json"]) == 0
    actions = json.loads(capsys.readouterr().out)["actions"].values()
    assert {one["accepted"]["reason"] for one in actions} == {"release notes name no change of arithmetic"}
    assert upgrade(done.workflow)[1] == "no step is stale: nothing was computed under another version\n"


def test_a_step_that_differs_is_named_and_runs_again_with_what_follows(
    done: Any,
    release: Release,
    upgrade: Callable[..., tuple[int, str, str]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    release("numpy")
    computed = clean.run

    def changed(inputs: Any, parameters: Any, places: Any) -> bytes:
        arrays = unpack(computed(inputs, parameters, places))
        return pack(**{**arrays, "points": arrays["points"][:-1]})

    monkeypatch.setattr(clean, "run", changed)
    status, _, err = upgrade(done.workflow, "--sample", 1, "--accept", "trial")
    assert status == 1
    assert "footscan: P0001/S1/clean: differs: points." in err
    _, reasons = done.plan()
    assert "clean" in reasons
    assert not any(name.startswith(("ingest", "extract", "map")) for name in reasons)
    assert {"fuse", "surface", "measure"} <= reasons.keys()


def test_a_reason_is_wanted(done: Any, upgrade: Callable[..., tuple[int, str, str]]) -> None:
    status, _, err = upgrade(done.workflow, "--accept", " ")
    assert (status, err) == (2, "footscan: --accept: expected a reason, which 'footscan trace' will show\n")
