"""Random graphs under random edits: results are those of an empty store, and nothing runs but what has to.

    FOOTSCAN_FUZZ=1000 pytest tests/pipelines/engine/test_random_graphs.py      1,000 graphs instead of a few

What has to run follows from a model that knows how the made-up steps compute, and nothing of keys and digests.
"""

import os
import tempfile
from collections import Counter
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel

from pipelines.engine.actions.step import Failure, Input, Output, SourceFile, Step, Value
from pipelines.engine.files.file_digests import FileDigests
from pipelines.engine.plan import State, make_plan
from pipelines.engine.pool import StepEnd, Threads
from pipelines.engine.run import run_plan
from pipelines.engine.store.store import Store, open_store

ASKED = os.environ.get("FOOTSCAN_FUZZ")

STEP_MODULES = {"one": ["near"], "two": ["near", "far"], "three": []}
"""Each with the helpers that it imports."""
HELPERS = {"near": ["far"], "far": []}
REACHED = {"one": ("one", "near", "far"), "two": ("two", "near", "far"), "three": ("three",)}
"""The modules on which a step's result depends, by the step's module."""

HELPER = '''
def value():
    """Documented, {comment}."""
    return {constant} + sum(helper.value() for helper in HELPERS)  # {comment}
'''

STEP = '''
from schemas.base.errors import Finding

def run(inputs, parameters, places):
    # {comment}
    total = {constant} + sum(helper.value() for helper in HELPERS)
    """Said of the line above, {comment}."""
    for name in sorted(inputs):
        content = places[name].read_bytes() if name in places else inputs[name]
        total += len(name) * sum(content)
    if parameters is not None:
        total = total * parameters.factor + len(type(parameters).__name__)
    if total % 5 == 4:
        raise Finding(f"{{total % 5}} is too much")
    return str(total % 5).encode()
'''


class Factor(BaseModel):
    factor: int | float


class Heavier(BaseModel):
    """What looks like a factor, and is none."""

    factor: int | float


@dataclass(frozen=True)
class Film:
    """An input that lies in a file."""

    name: str


@dataclass(frozen=True)
class Drawn:
    """A step of a random graph."""

    scan: str
    kind: str
    module: str
    parameters: Factor | Heavier | None
    inputs: Mapping[str, int | bytes | Film]
    """A number is that of an earlier step."""


@dataclass(frozen=True)
class World:
    """All that an edit can change."""

    steps: tuple[Drawn, ...]
    films: Mapping[str, bytes]
    constants: Mapping[str, int]
    """In the code of each module."""
    comments: Mapping[str, int]
    """In the code of each module, of no consequence."""


numbers = st.integers(0, 3)
contents = st.sampled_from([b"", b"a", b"b", b"ab", b"ba"])
parameters = st.none() | st.builds(
    lambda model, factor: model(factor=factor), st.sampled_from([Factor, Heavier]), st.sampled_from([1, 2, 2.0, 0.5])
)
films = st.sampled_from([Film("left"), Film("right")])
of_modules = st.fixed_dictionaries(dict.fromkeys((*STEP_MODULES, *HELPERS), numbers))


@st.composite
def drawn_steps(draw: st.DrawFn) -> tuple[Drawn, ...]:
    steps = []
    for number in range(draw(st.integers(1, 7))):
        earlier = st.integers(0, number - 1) if number else st.nothing()
        inputs = draw(st.dictionaries(st.sampled_from(["a", "bb", "ccc"]), earlier | earlier | contents | films))
        module, kind = draw(st.sampled_from(sorted(STEP_MODULES))), draw(st.sampled_from(["extract", "merge"]))
        steps.append(Drawn(f"P/{number}", kind, module, draw(parameters), inputs))
    return tuple(steps)


worlds = st.builds(
    World, drawn_steps(), st.fixed_dictionaries({"left": contents, "right": contents}), of_modules, of_modules
)


@st.composite
def histories(draw: st.DrawFn) -> list[World]:
    """A world, and what edits make of it, one after the other."""
    history = [draw(worlds)]
    for _ in range(draw(st.integers(1, 5))):
        history.append(draw(st.sampled_from(EDITS))(draw, history))
    return history


def edit_code(draw: st.DrawFn, history: list[World]) -> World:
    constants = {**history[-1].constants, draw(st.sampled_from(sorted(history[-1].constants))): draw(numbers)}
    return replace(history[-1], constants=constants)


def edit_comment(draw: st.DrawFn, history: list[World]) -> World:
    return replace(history[-1], comments=draw(of_modules))


def edit_film(draw: st.DrawFn, history: list[World]) -> World:
    return replace(history[-1], films={**history[-1].films, draw(films).name: draw(contents)})


def edit_parameters(draw: st.DrawFn, history: list[World]) -> World:
    return _with_step(draw, history[-1], lambda step: replace(step, parameters=draw(parameters)))


def edit_model(draw: st.DrawFn, history: list[World]) -> World:
    """The same number is another thing."""

    def edited(step: Drawn) -> Drawn:
        if step.parameters is None:
            return step
        other = {Factor: Heavier, Heavier: Factor}[type(step.parameters)]
        return replace(step, parameters=other(factor=step.parameters.factor))

    return _with_step(draw, history[-1], edited)


def edit_inputs(draw: st.DrawFn, history: list[World]) -> World:
    """An input of its own is another one, or is added."""

    def edited(step: Drawn) -> Drawn:
        name = draw(st.sampled_from(["a", "bb", "ccc"]))
        return replace(step, inputs={**step.inputs, name: draw(contents | films)})

    return _with_step(draw, history[-1], edited)


def edit_back(draw: st.DrawFn, history: list[World]) -> World:
    return draw(st.sampled_from(history))


EDITS = (edit_code, edit_code, edit_comment, edit_film, edit_parameters, edit_model, edit_inputs, edit_back)


def _with_step(draw: st.DrawFn, world: World, edited: Callable[[Drawn], Drawn]) -> World:
    steps = list(world.steps)
    number = draw(st.integers(0, len(steps) - 1))
    steps[number] = edited(steps[number])
    return replace(world, steps=tuple(steps))


@pytest.mark.slow
@settings(
    max_examples=30 if ASKED is None else int(ASKED),
    derandomize=ASKED is None,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(history=histories(), workers=st.sampled_from([1, 3]), remembers=st.booleans())
def test_what_runs_is_what_has_to(package: Any, history: list[World], workers: int, remembers: bool) -> None:
    seen: set[Hashable] = set()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number, world in enumerate(history):
            write_world(world, package, folder)
            steps = engine_steps(world, package, folder)
            expected, keys = model(world)

            results, ran = run(
                steps, open_store(folder / "store", folder / "known.sqlite" if remembers else None), workers
            )
            assert results == expected
            times = Counter(keys[step] for step in ran)
            assert times.keys() == set(keys.values()) - seen
            if workers == 1:  # at the same time, two may both do what neither finds done
                assert set(times.values()) <= {1}
            seen |= set(keys.values())

            fresh, _ = run(steps, open_store(folder / f"empty {number}"), workers)
            assert fresh == expected


Outcome = bytes | tuple[str, str]
"""A result, or a problem and the name of the step that has it."""


def model(world: World) -> tuple[dict[str, Outcome], dict[str, Hashable]]:
    """Outcome of every step by name; and all that decides what a step comes to, of each that has what it needs."""
    names = [f"{step.scan}/{step.kind}" for step in world.steps]
    outcomes: dict[str, Outcome] = {}
    keys: dict[str, Hashable] = {}
    for name, step in zip(names, world.steps, strict=True):
        taken: dict[str, tuple[str, bytes]] = {}
        failed = None
        for label, given_input in step.inputs.items():
            if isinstance(given_input, Film):
                taken[label] = "file", world.films[given_input.name]
            elif isinstance(given_input, bytes):
                taken[label] = "value", given_input
            else:
                before = outcomes[names[given_input]]
                if isinstance(before, bytes):
                    taken[label] = "result", before
                else:
                    failed = failed or before
        if failed:
            outcomes[name] = failed
            continue
        code = tuple((module, world.constants[module]) for module in REACHED[step.module])
        keys[name] = (step.kind, code, repr(step.parameters), tuple(sorted(taken.items())))
        total: float = sum(_value(helper, world) for helper in STEP_MODULES[step.module]) + world.constants[step.module]
        total += sum(len(label) * sum(content) for label, (_, content) in taken.items())
        if step.parameters is not None:
            total = total * step.parameters.factor + {"Factor": 6, "Heavier": 7}[type(step.parameters).__name__]
        rest = total % 5
        outcomes[name] = (f"{rest} is too much", name) if rest == 4 else str(rest).encode()
    return outcomes, keys


def _value(helper: str, world: World) -> int:
    return world.constants[helper] + (world.constants["far"] if helper == "near" else 0)


def write_world(world: World, package: Any, folder: Path) -> None:
    for name, imports in (STEP_MODULES | HELPERS).items():
        lines = [f"# {world.comments[name]}", f'"""Version {world.comments[name]}."""', ""]
        lines += [f"from PACKAGE import {helper}" for helper in imports]
        lines.append(f"HELPERS = [{', '.join(imports)}]")
        text = STEP if name in STEP_MODULES else HELPER
        body = text.format(constant=world.constants[name], comment=world.comments[name])
        package.write(name, "\n".join(lines) + "\n" * world.comments[name] + body)
    package.forget()
    for name, content in world.films.items():
        (folder / name).write_bytes(content)


def engine_steps(world: World, package: Any, folder: Path) -> list[Step]:
    digests = FileDigests(folder / "files.json")
    steps: list[Step] = []
    for step in world.steps:
        inputs: dict[str, Input] = {}
        places = {}
        for label, given_input in step.inputs.items():
            if isinstance(given_input, Film):
                path = places[label] = folder / given_input.name
                digest, state = digests.of(path)
                inputs[label] = SourceFile(path, digest, ((path, state),))
            elif isinstance(given_input, bytes):
                inputs[label] = Value(given_input)
            else:
                inputs[label] = Output(steps[given_input].name)
        module = f"{package.name}.{step.module}"
        steps.append(Step(step.scan, step.kind, module, step.parameters, inputs, places=places))
    return steps


def run(steps: list[Step], store: Store, workers: int) -> tuple[dict[str, Outcome], list[str]]:
    """Outcomes by name, and the names of the steps that ran."""
    ends: list[StepEnd] = []
    plan = make_plan(steps, store)
    outcomes = run_plan(plan, store, pool=Threads(workers), on_step_end=ends.append)
    ran = [end.step.name for end in ends if end.ran]
    states = {planned.step.name: planned.state for planned in plan.steps}
    assert all(states[name] is not State.HIT for name in ran)
    found: dict[str, Outcome] = {}
    for name, outcome in outcomes.items():
        if isinstance(outcome, Failure):
            assert outcome.kind == "finding"
            found[name] = outcome.problem, outcome.cause
        else:
            content = store.get(outcome.digest)
            assert content is not None
            found[name] = content
    if store.verified is not None:
        store.verified.close()
    return found, ran
