"""The first steps in which two runs differ."""

from pathlib import Path

import pytest

from pipelines.engine.actions.key import image_text, key_of
from pipelines.engine.actions.step import Input, Output, Step, Value
from pipelines.engine.store.store import Store, open_store
from pipelines.regression.first_step import EarlierSteps, PresentStep, first_steps
from schemas.regression import AcceptedStep


def step(name: str, *before: str) -> Step:
    kind, _, camera = name.partition("-")
    inputs: dict[str, Input] = {one: Output(f"P/S/{one}") for one in before} or {"film": Value(b"{}")}
    return Step("P/S", kind, "pipelines.steps.fuse", None, inputs, int(camera) if camera else None)


CHAIN = [
    step("film"), step("calibrate"),
    step("ingest-1"), step("extract-1", "ingest-1"), step("map-1", "extract-1"),
    step("ingest-2"), step("extract-2", "ingest-2"), step("map-2", "extract-2"),
    step("clean", "map-1", "map-2"), step("surface", "clean"), step("measure", "surface"),
]  # fmt: skip
NAMES = [one.name.removeprefix("P/S/") for one in CHAIN]
ACCEPTED = [AcceptedStep(step=name, key="0" * 64, result="a" * 64) for name in NAMES]


def present(differing: set[str], missing: set[str] = frozenset()) -> list[PresentStep]:  # type: ignore[assignment]
    return [
        PresentStep(one, "1" * 64, "{}", ("b" if name in differing else "a") * 64)
        for one, name in zip(CHAIN, NAMES, strict=True)
        if name not in missing
    ]


AFTER = {"clean", "surface", "measure"}


@pytest.mark.parametrize(
    ("differing", "missing", "expected"),
    [
        (set(), set(), []),
        ({"measure"}, set(), [(["measure"], "its result differs")]),
        (
            {"extract-1", "map-1", "extract-2", "map-2", *AFTER},
            set(),
            [(["extract-1", "extract-2"], "its result differs")],
        ),
        ({"extract-2", "map-2", *AFTER}, set(), [(["extract-2"], "its result differs")]),
        ({"calibrate", "map-1", "map-2", *AFTER}, set(), [(["calibrate"], "its result differs")]),
        ({"film", "ingest-1", "extract-1", "map-1", *AFTER}, set(), [(["film"], "its result differs")]),
        (AFTER, {"ingest-2", "extract-2", "map-2"}, [(["ingest-2"], "no longer exists")]),
        (set(), {"measure"}, [(["measure"], "no longer exists")]),
    ],
)  # fmt: skip
def test_first(differing: set[str], missing: set[str], expected: list[tuple[list[str], str]], tmp_path: Path) -> None:
    found = first_steps(EarlierSteps(ACCEPTED), present(differing, missing), open_store(tmp_path))
    assert [(list(one.steps), one.why) for one in found] == expected


ELSEWHERE = [AcceptedStep(step=name, key="2" * 64, result="e" * 64) for name in NAMES]


@pytest.mark.parametrize(
    ("differing", "missing", "expected"),
    [
        (set(), set(), []),
        ({"map-2", *AFTER}, set(), [(["map-2"], "its result differs")]),
        (AFTER, {"ingest-2", "extract-2", "map-2"}, [(["ingest-2"], "no longer exists")]),
    ],
)
def test_first_since_the_last_good_night_where_the_baseline_is_from_elsewhere(
    differing: set[str], missing: set[str], expected: list[tuple[list[str], str]], tmp_path: Path
) -> None:
    found = first_steps(EarlierSteps(ELSEWHERE, ACCEPTED), present(differing, missing), open_store(tmp_path))
    assert [(list(one.steps), one.why) for one in found] == expected


def test_a_step_that_came_after_the_baseline_and_is_known_from_the_last_good_night(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    assert first_steps(EarlierSteps(ACCEPTED[:-1], ACCEPTED), present(set()), store) == []
    assert first_steps(EarlierSteps(ACCEPTED, ACCEPTED[:-1]), present(set(), {"measure"}), store) == []


def test_nothing_accepted_and_a_step_that_is_new(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    assert first_steps(EarlierSteps([]), present({"clean"}), store) == []
    [found] = first_steps(EarlierSteps(ACCEPTED[:-1]), present(set()), store)
    assert (list(found.steps), found.why) == (["measure"], "is new")


def test_what_changed_is_told_where_the_store_still_knows(tmp_path: Path) -> None:
    import json

    from pipelines.engine.store.store import Row

    store: Store = open_store(tmp_path)
    image = json.loads(image_text(CHAIN[-1], {"surface": "a" * 64}))
    values = {"side": "left", "settings": {"seed": 1, "frames": 36}}
    before = {**image, "parameters": {"model": "FootParameters", "values": values}}
    other = {"side": "right", "settings": {"seed": 2, "frames": 36}}
    now = {**image, "parameters": {"model": "FootParameters", "values": other}}
    store.record("P/S/measure", Row(before, "a" * 64))
    accepted = [*ACCEPTED[:-1], AcceptedStep(step="measure", key=key_of(before), result="a" * 64)]
    steps = [*present(set())[:-1], PresentStep(CHAIN[-1], key_of(now), json.dumps(now), "b" * 64)]
    [found] = first_steps(EarlierSteps(accepted), steps, store)
    assert [change.text for change in found.changes] == [
        "parameter settings changed: seed 1 → 2",
        'parameter side changed: "left" → "right"',
    ]
