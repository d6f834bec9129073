"""The key of an action depends on all that decides its result, and on nothing else."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from pipelines.engine import code
from pipelines.engine.key import difference, key_of, pre_image
from pipelines.engine.step import Step
from pipelines.steps import clean, orient
from schemas.documents import Document
from schemas.parameters.normals import NormalParameters
from schemas.parameters.outliers import OutlierParameters

DIGESTS = {"cloud": "a" * 64, "other": "b" * 64}


def key(step: Step, digests: dict[str, str] = DIGESTS) -> str:
    return key_of(pre_image(step, digests))


def clean_step(**changes: Any) -> Step:
    return Step(**{"scan": "P/S", "kind": "clean", "module": clean, "parameters": OutlierParameters()} | changes)


def test_is_the_same_in_another_process() -> None:
    program = (
        "from pipelines.engine.key import *; from pipelines.engine.step import Step\n"
        "from pipelines.steps import orient; from schemas.parameters.normals import NormalParameters\n"
        f"step = Step('P/S', 'orient', orient, NormalParameters())\nprint(key_of(pre_image(step, {DIGESTS!r})))"
    )
    found = {key(Step("P/S", "orient", orient, NormalParameters()))}
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        command = [sys.executable, "-c", program]
        found.add(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout.strip())
    assert len(found) == 1
    assert len(found.pop()) == 64


def test_does_not_depend_on_the_order_of_names() -> None:
    assert key(clean_step(), DIGESTS) == key(clean_step(), dict(reversed(DIGESTS.items())))
    directions = {1: (0.0, 1.0), 2: (1.0, 0.0)}
    steps = [
        clean_step(parameters=NormalParameters(camera_directions=given))
        for given in (directions, dict(reversed(directions.items())))
    ]
    assert key(steps[0]) == key(steps[1])


def test_does_not_depend_on_where_things_lie() -> None:
    moved = clean_step(scan="Q/T", camera=3, places={"film": Path("/elsewhere")}, writes=Path("/elsewhere/x"))
    assert key(moved) == key(clean_step())


@pytest.mark.parametrize(
    ("changed", "digests"),
    [
        (clean_step(kind="other"), DIGESTS),
        (clean_step(module=orient), DIGESTS),
        (clean_step(parameters=OutlierParameters(neighbours=25)), DIGESTS),
        (clean_step(parameters=None), DIGESTS),
        (clean_step(), DIGESTS | {"cloud": "c" * 64}),
        (clean_step(), {"cloud": "b" * 64, "other": "a" * 64}),
        (clean_step(), {"cloud": "a" * 64}),
        (clean_step(), {}),
    ],
)
def test_depends_on_step_parameters_and_inputs(changed: Step, digests: dict[str, str]) -> None:
    assert key(changed, digests) != key(clean_step())


def test_depends_on_code_and_libraries(package: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    source = "import numpy\nimport PACKAGE.helper\ndef run(inputs, parameters, places):\n    return b''\n"
    package.write("helper", "X = 1")
    keys = {key(clean_step(module=package.step_module("step", source)))}
    package.write("helper", "X = 2")
    keys.add(key(clean_step(module=package.load("step"))))
    package.forget()
    monkeypatch.setattr(code, "_version", lambda _: "999")
    keys.add(key(clean_step(module=package.load("step"))))
    assert len(keys) == 3


def test_parameters_that_are_no_number_have_no_key() -> None:
    class Loose(Document, allow_inf_nan=True):
        x: float

    image = pre_image(clean_step(parameters=Loose(x=1.0)), {})
    image["parameters"]["x"] = float("nan")
    with pytest.raises(ValueError, match="not JSON compliant"):
        key_of(image)


def test_difference_names_what_changed() -> None:
    old = pre_image(clean_step(), DIGESTS)
    assert difference(old, pre_image(clean_step(), DIGESTS | {"cloud": "c" * 64})) == "input cloud changed"
    assert difference(old, pre_image(clean_step(), {"cloud": "a" * 64})) == "input other changed"
    other = pre_image(clean_step(parameters=OutlierParameters(neighbours=25, island_share=0.1)), DIGESTS)
    assert difference(old, other) == "parameter island_share changed, parameter neighbours changed"
    assert difference(old, pre_image(clean_step(parameters=None), {})).startswith("input cloud changed, input other")
    assert difference(old, old | {"code": old["code"] | {"footscan.cloud.outliers": ""}}) == (
        "code of footscan.cloud.outliers changed"
    )
    assert difference(old, old | {"libraries": old["libraries"] | {"numpy": "0"}}) == "numpy changed"
    assert difference(old, old) == "its result is gone"
