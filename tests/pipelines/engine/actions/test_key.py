"""The key of an action depends on everything that its result depends on, and on nothing else."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from pipelines.engine.actions import libraries
from pipelines.engine.actions.key import image_text, key_of
from pipelines.engine.actions.step import Output, SourceFile, Step, Value
from schemas.base.model import Document, canonical_json
from schemas.parameters.normals import NormalParameters
from schemas.parameters.outliers import OutlierParameters

DIGESTS = {"cloud": "a" * 64, "other": "b" * 64}


def image(step: Step, digests: dict[str, str] = DIGESTS) -> str:
    return image_text(step._replace(inputs={name: Output("P/S/before") for name in digests}), digests)


def key(step: Step, digests: dict[str, str] = DIGESTS) -> str:
    return key_of(image(step, digests))


def clean_step(**changes: Any) -> Step:
    given = {"module": "pipelines.steps.clean", "parameters": OutlierParameters()}
    return Step(**{"scan": "P/S", "kind": "clean"} | given | changes)


def test_is_written_as_canonical_json() -> None:
    awkward = {"ä": "a" * 64, 'a "name"': "b" * 64, "back\\slash\n": "c" * 64, "A": "d" * 64}
    for step in (clean_step(), clean_step(parameters=None), clean_step(kind='an "odd" kind')):
        text = image(step, awkward)
        assert text == canonical_json(json.loads(text))
        assert key_of(text) == key_of(json.loads(text))
    assert json.loads(text)["inputs"]["A"] == ["result", "d" * 64]


def test_what_kind_of_input_it_is_counts() -> None:
    inputs = [Output("P/S/before"), Value(b"x"), SourceFile(Path("film"), "", ())]
    keys = {key_of(image_text(clean_step(inputs={"x": source}), {"x": "a" * 64})) for source in inputs}
    assert len(keys) == 3


def test_is_the_same_in_another_process() -> None:
    program = (
        "from pipelines.engine.actions.key import *; from pipelines.engine.actions.step import Step\n"
        "from schemas.parameters.normals import NormalParameters\n"
        "step = Step('P/S', 'orient', 'pipelines.steps.orient', NormalParameters())\n"
        "print(key_of(image_text(step, {})))"
    )
    found = {key(Step("P/S", "orient", "pipelines.steps.orient", NormalParameters()), {})}
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        command = [sys.executable, "-c", program]
        found.add(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout.strip())
    assert len(found) == 1
    assert len(found.pop()) == 64


class ByName(Document):
    of: dict[str, float]


def test_does_not_depend_on_the_order_of_names() -> None:
    assert key(clean_step(), DIGESTS) == key(clean_step(), dict(reversed(DIGESTS.items())))
    named = {"a": 1.0, "b": 2.0}
    steps = [clean_step(parameters=ByName(of=given)) for given in (named, dict(reversed(named.items())))]
    assert key(steps[0]) == key(steps[1])


def test_does_not_depend_on_where_things_lie() -> None:
    moved = clean_step(scan="Q/T", camera=3, places={"film": Path("/elsewhere")}, writes=Path("/elsewhere/x"))
    assert key(moved) == key(clean_step())


@pytest.mark.parametrize(
    ("changed", "digests"),
    [
        (clean_step(kind="other"), DIGESTS),
        (clean_step(module="pipelines.steps.orient"), DIGESTS),
        (clean_step(parameters=OutlierParameters(shortest=4)), DIGESTS),
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
    monkeypatch.setattr(libraries, "_version", lambda _: "999")
    keys.add(key(clean_step(module=package.load("step"))))
    assert len(keys) == 3


def test_parameters_that_are_no_number_have_no_key() -> None:
    class Loose(Document, allow_inf_nan=True):
        x: float

    with pytest.raises(ValueError, match="not JSON compliant"):
        image(clean_step(parameters=Loose(x=float("nan"))))


def test_equal_numbers_of_two_types_are_not_the_same() -> None:
    class Loose(Document):
        x: Any

    assert len({key(clean_step(parameters=Loose(x=x))) for x in (1, 1.0, True, "1")}) == 4
