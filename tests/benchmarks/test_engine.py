"""The graph that the engines are given: its shape, and that every one of them runs it once and then no more."""

import importlib
import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from pipelines.engine.actions.step import Output


@pytest.fixture(scope="module")
def engine() -> Iterator[Any]:
    """The module; benchmarks are no installed package."""
    with pytest.MonkeyPatch.context() as patch:
        root = Path(__file__).parents[2]
        patch.syspath_prepend(root)
        patch.chdir(root)  # the processes that it starts find it there
        yield importlib.import_module("benchmarks.engine")


def test_five_hundred_scans_are_twenty_thousand_steps(engine: Any) -> None:
    assert engine.SCANS * len(engine.SHAPE) == 20_000


def test_steps_are_drawn_in_order_and_as_the_others_have_them(engine: Any) -> None:
    steps = engine.draw(2)
    assert len({step.name for step in steps}) == len(steps) == 80
    drawn: set[str] = set()
    for step, (node, taken) in zip(steps, [*engine.SHAPE.items()] * 2, strict=True):
        assert step.name.rpartition("/")[2].replace("-", "_") == node
        before = {source.step for source in step.inputs.values() if isinstance(source, Output)}
        assert before <= drawn
        assert {name.rpartition("/")[2].replace("-", "_") for name in before} == engine.SHAPE.keys() & set(taken)
        assert (step.parameters is not None) == bool(engine.MODELS.keys() & set(taken))
        drawn.add(step.name)


@pytest.mark.parametrize("name", ["footscan", "joblib_results", "hamilton_disk"])
def test_what_has_run_runs_no_more(engine: Any, tmp_path: Path, name: str) -> None:
    if name != "footscan" and importlib.util.find_spec(name.partition("_")[0]) is None:
        pytest.skip("needs the optional dependencies `benchmarks`")
    engine.write_package(tmp_path)
    arguments = (name, tmp_path, tmp_path / "store", 1)
    assert engine.in_process("prepare", *arguments)["ran"] == 40
    assert engine.in_process("walk", *arguments)["ran"] == 0
