"""The differences between two actions of one step."""

import json
from pathlib import Path
from typing import Any

import pytest

from pipelines.engine.actions.key import image_text
from pipelines.engine.actions.step import Output, Step, Value
from pipelines.engine.explain import BETWEEN, Change, changes, code_of, inputs_of, kind_of, reason, side_by_side
from pipelines.engine.files.names import blob_name
from pipelines.engine.store.store import Store
from schemas.base.model import Document


class Factor(Document):
    factor: int = 2
    shift: int = 0


class Shift(Document):
    factor: int = 2
    shift: int = 0


def image(step: Step, **digests: str) -> dict[str, Any]:
    known = {name: source.digest for name, source in step.inputs.items() if isinstance(source, Value)}
    text: dict[str, Any] = json.loads(image_text(step, known | digests))
    return text


def test_parameters_old_and_new(package: Any, store: Store) -> None:
    module = package.step_module("join")
    old, new = (Step("P/S", "join", module, Factor(factor=factor)) for factor in (2, 3))
    found = changes(new, image(old), image(new), store)
    assert found == [Change("parameter", "factor", "2", "3")]
    assert reason(found) == "parameter factor changed"
    assert changes(new, image(new), image(new), store) == []
    other = Step("P/S", "join", module, Shift(factor=3))
    assert changes(other, image(new), image(other), store) == [Change("parameters", "model", '"Factor"', '"Shift"')]
    none = Step("P/S", "join", module)
    assert [str(change) for change in changes(none, image(new), image(none), store)] == [
        "parameter factor changed", "parameter shift changed",
    ]  # fmt: skip


def test_an_input_that_is_a_result_names_its_step(package: Any, store: Store) -> None:
    step = Step("P/S", "map", package.step_module("join"), None, {"stripe": Output("P/S/extract-3")})
    old, new = image(step, stripe="a" * 64), image(step, stripe="b" * 64)
    assert changes(step, old, new, store) == [Change("input", "stripe", "a" * 64, "b" * 64, "P/S/extract-3")]


def test_a_small_value_is_shown_itself_if_the_store_has_it(package: Any, store: Store) -> None:
    module = package.step_module("join")
    old, new = (Step("P/S", "map", module, None, {"travel": Value(b)}) for b in (b'{"step":2}', b'{"step":3}'))
    before = old.inputs["travel"]
    assert isinstance(before, Value)
    [change] = changes(new, image(old), image(new), store)
    assert (change.old, change.new) == (before.digest, '{\n "step": 3\n}')
    store.put(before.content)
    [change] = changes(new, image(old), image(new), store)
    assert side_by_side(change) == [("{", "{"), (' "step": 2', ' "step": 3'), ("}", "}")]


def test_code_line_by_line(package: Any, store: Store, run_steps: Any) -> None:
    package.write(
        "helper", "def scale(x):\n    y = x\n    return 2 * y\n\ndef far():\n    a = 1\n    b = 2\n    return 3"
    )
    source = "from PACKAGE.helper import scale\ndef run(*_):\n    return b'x'\n"
    step = Step("P/S", "join", package.step_module("join", source))
    old = image(step)
    run_steps(step)
    package.write(
        "helper", "def scale(x):\n    y = x\n    return 3 * y\n\ndef far():\n    a = 1\n    b = 2\n    return 4"
    )
    package.forget()
    [change] = changes(step, old, image(step), store)
    assert str(change) == f"code of {package.name}.helper changed"
    assert side_by_side(change) == [
        ("    y = x", "    y = x"), ("    return 2 * y", "    return 3 * y"), ("", ""),
        BETWEEN, ("    b = 2", "    b = 2"), ("    return 3", "    return 4"),
    ]  # fmt: skip
    store.files.remove(blob_name(old["code"]))
    assert changes(step, old, image(step), store) == [Change("code", step.module, None, None)]


def test_lines_on_one_side_stand_beside_empty_ones() -> None:
    assert side_by_side(Change("code", "m", "a\nb", "a\nx\ny\nb")) == [("a", "a"), ("", "x"), ("", "y"), ("b", "b")]
    assert side_by_side(Change("code", "m", "a\nb\nc", "a\nB")) == [("a", "a"), ("b", "B"), ("c", "")]
    assert side_by_side(Change("code", "m", None, "a")) == [("", "a")]
    assert side_by_side(Change("code", "m", "a", "a")) == []


def test_a_library_of_another_version(package: Any, store: Store) -> None:
    step = Step("P/S", "join", package.step_module("join"))
    was = code_of(image(step), store)
    assert was is None  # nothing has run
    new = image(step)
    digest = store.put(b'{"libraries":{"numpy":"1.0"},"modules":{}}')
    found = {
        (change.what, change.name): (change.old, change.new)
        for change in changes(step, new | {"code": digest}, new, store)
    }
    assert found["library", "numpy"] == ("1.0", None)
    assert found["library", "python"][0] is None
    assert found["code", step.module][0] is None


@pytest.mark.parametrize(
    "hostile",
    [None, [], "x", {}, {"inputs": 7}, {"inputs": {"a": "b"}}, {"inputs": {"a": ["result", "../../x"]}},
     {"inputs": {"a": ["result", 7]}}, {"parameters": "x"}, {"parameters": {"values": [1]}}, {"code": "../../x"},
     {"code": 7}, {"step": ["x"]}],
)  # fmt: skip
def test_an_image_made_by_hand_tells_nothing(package: Any, store: Store, tmp_path: Path, hostile: Any) -> None:
    (tmp_path / "x").write_bytes(b"precious")
    step = Step("P/S", "join", package.step_module("join"), None, {"a": Value(b"")})
    assert inputs_of(hostile) == {}
    assert kind_of(hostile) == "unknown"
    assert code_of(hostile, store) is None
    assert "input a changed" in reason(changes(step, hostile, image(step), store))


@pytest.mark.parametrize(
    "document", [b"", b"[]", b"{}", b'{"modules":[],"libraries":{}}', b'{"modules":{"a":"../x"},"libraries":{}}']
)
def test_a_code_document_made_by_hand_tells_nothing(store: Store, document: bytes) -> None:
    assert code_of({"code": store.put(document)}, store) is None
