"""Traces name all actions that a result came from."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipelines.engine.actions.key import key_of
from pipelines.engine.actions.step import Output, SourceFile, Step, Value
from pipelines.engine.files.file_digests import FileDigests
from pipelines.engine.files.names import blob_digest, row_key, row_name
from pipelines.engine.store.store import Row, Store
from pipelines.engine.trace import Trace, read_actions, trace
from schemas.base.model import Document


class Factor(Document):
    factor: int


Chain = Callable[..., list[Step]]


def traced(digest: str, store: Store, scan: str = "") -> Trace:
    origin = trace(digest, read_actions(store), store, scan)
    assert origin is not None
    assert origin.made_by in origin.actions
    return origin


def result(outcomes: Any, kind: str) -> str:
    return str(outcomes[kind].digest)


@pytest.fixture
def chain(package: Any, tmp_path: Path) -> Chain:
    """ingest-3(film), which returns its bytes unchanged; extract-3(ingest, remark)."""
    copy = package.step_module(
        "copy", "import numpy\ndef run(inputs, parameters, places):\n    return places['film'].read_bytes()"
    )
    join = package.step_module("join")

    def draw(scan: str = "P/S", factor: int = 2, remark: bytes = b"{}") -> list[Step]:
        film = tmp_path / "archive" / scan / "cam3.avi"
        film.parent.mkdir(parents=True, exist_ok=True)
        film.write_bytes(b"frames")
        digest, state = FileDigests(tmp_path / "files.json").of(film)
        source = SourceFile(film, digest, ((film, state),))
        inputs = {"manifest": Output(f"{scan}/ingest-3"), "remark": Value(remark)}
        return [
            Step(scan, "ingest", copy, None, {"film": source}, 3, places={"film": film}),
            Step(scan, "extract", join, Factor(factor=factor), inputs, 3),
        ]

    return draw


def test_down_to_films_and_versions(chain: Chain, store: Store, run_steps: Any, tmp_path: Path) -> None:
    outcomes, _ = run_steps(*chain(remark=b'{"a":1}'))
    origin = traced(result(outcomes, "extract"), store)
    extract = origin.actions[origin.made_by]
    assert (extract.step, extract.kind) == ("P/S/extract-3", "extract")
    assert extract.parameters == {"model": "Factor", "values": {"factor": 2}}
    assert extract.result == result(outcomes, "extract")
    manifest, remark = extract.inputs
    assert (remark.name, remark.source, remark.content, remark.made_by) == ("remark", "value", b'{"a":1}', None)
    assert (manifest.name, manifest.source, manifest.digest) == ("manifest", "result", result(outcomes, "ingest"))
    assert manifest.made_by is not None
    ingest = origin.actions[manifest.made_by]
    assert ingest.step == "P/S/ingest-3"
    assert set(ingest.libraries) == {"numpy", "python"}
    [film] = ingest.inputs
    assert (film.source, film.place) == ("file", str(tmp_path / "archive/P/S/cam3.avi"))
    assert len(origin.actions) == 2


def test_what_no_step_made(chain: Chain, store: Store, run_steps: Any) -> None:
    run_steps(*chain())
    assert trace("0" * 64, read_actions(store), store) is None


def test_of_equal_films_the_scans_own(store: Store) -> None:
    film = {"film": ["file", "f" * 64]}
    row = Row({"step": "ingest", "code": "c" * 64, "parameters": None, "inputs": film}, store.put(b"manifest"))
    for scan in ("P/S", "P/T", "P/U"):
        store.record(f"{scan}/ingest-3", row, {"film": f"/archive/{scan}/cam3.avi"})
    for scan in ("P/T", "P/S", "P/U"):
        [ingest] = traced(str(row.digest), store, scan).actions.values()
        assert ingest.step == f"{scan}/ingest-3"
        assert [taken.place for taken in ingest.inputs] == [f"/archive/{scan}/cam3.avi"]


def test_of_equal_results_the_scans_own(store: Store) -> None:
    digest = store.put(b"empty")
    for number, scan in enumerate(("P/S", "P/T", "P/U")):
        image = {"step": "x", "code": "c" * 64, "parameters": {"values": {"n": number}}, "inputs": {}}
        store.record(f"{scan}/x", Row(image, digest))
    for scan in ("P/T", "P/S", "P/U"):
        [made] = traced(digest, store, scan).actions.values()
        assert made.step == f"{scan}/x"


def test_an_earlier_action_is_traced_though_its_step_has_gone_on(chain: Chain, store: Store, run_steps: Any) -> None:
    outcomes, _ = run_steps(*chain(factor=2))
    run_steps(*chain(factor=3))
    origin = traced(result(outcomes, "extract"), store)
    assert origin.actions[origin.made_by].step is None
    assert origin.actions[origin.made_by].parameters["values"] == {"factor": 2}
    assert len(origin.actions) == 2


def test_of_cameras_with_equal_results_each_its_own(package: Any, store: Store, run_steps: Any) -> None:
    empty = package.step_module("empty", "def run(*_):\n    return b'no stripe'\n")
    join = package.step_module("join")
    extract = [Step("P/S", "extract", empty, None, {"film": Value(bytes([n]))}, n) for n in (1, 2, 3)]
    stripes = {f"stripe-{n}": Output(f"P/S/extract-{n}") for n in (1, 2, 3)}
    step = Step("P/S", "fuse", join, None, stripes)
    store_outcomes, _ = run_steps(*extract, step)
    origin = traced(result(store_outcomes, "fuse"), store)
    made = {taken.name: origin.actions[str(taken.made_by)].step for taken in origin.actions[origin.made_by].inputs}
    assert made == {f"stripe-{n}": f"P/S/extract-{n}" for n in (1, 2, 3)}


def test_a_step_that_gives_back_what_it_took_does_not_come_from_itself(store: Store) -> None:
    digest = store.put(b"cloud")
    loops = [
        {"step": kind, "code": "c" * 64, "parameters": None, "inputs": {"cloud": ["result", digest]}}
        for kind in ("clean", "orient")
    ]
    for image in loops:
        store.record(f"P/S/{image['step']}", Row(image, digest))
    origin = traced(digest, store)
    first = origin.actions[origin.made_by]
    [taken] = first.inputs
    assert taken.made_by is not None
    assert taken.made_by != origin.made_by
    [last] = origin.actions[taken.made_by].inputs
    assert last.made_by is None


def test_a_value_that_names_a_file_leads_on_to_who_made_it(package: Any, store: Store, run_steps: Any) -> None:
    join = package.step_module("join")
    outcomes, _ = run_steps(Step("demo", "calibrate", join, None, {"capture": Value(b"capture")}))
    source = f'{{"name":"calibration.json","sha256":"{result(outcomes, "calibrate")}"}}'.encode()
    outcomes, _ = run_steps(Step("P/S", "quality", join, None, {"calibration": Value(source)}))
    origin = traced(result(outcomes, "quality"), store)
    [taken] = origin.actions[origin.made_by].inputs
    assert origin.actions[str(taken.made_by)].step == "demo/calibrate"


def test_names_of_files_that_are_no_rows_and_no_blobs() -> None:
    digest = "ab" * 32
    assert row_key(f"actions/ab/{digest}.json") == digest
    assert blob_digest(f"blobs/ab/{digest}") == digest
    for name in (
        f"actions/ac/{digest}.json",
        f"actions/ab/{digest}",
        f"actions/{digest}.json",
        f"blobs/ab/{digest}.json",
    ):
        assert row_key(name) is None
    for name in (f"blobs/ac/{digest}", f"blobs/{digest}", f"blobs/ab/.{digest}.1-2.partial", f"actions/ab/{digest}"):
        assert blob_digest(name) is None


def test_a_row_made_by_hand_is_left_out(store: Store) -> None:
    digest = store.put(b"x")
    image: Any = ["no", "mapping"]
    store.record("P/S/x", Row(image, digest))
    assert store.files.state(row_name(key_of(image))) is not None
    assert read_actions(store).rows == {}
