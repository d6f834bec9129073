"""Audits find and remove damaged files, and find actions whose repetition differs."""

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipelines.engine.actions.key import key_of
from pipelines.engine.actions.step import Output, SourceFile, Step, Value
from pipelines.engine.audit import Audit, Difference, repeat, repeatable, sample, verify
from pipelines.engine.files.digest import sha256
from pipelines.engine.files.file_digests import FileDigests
from pipelines.engine.files.names import blob_name, latest_name, row_name
from pipelines.engine.plan import make_plan
from pipelines.engine.store.lease import lease
from pipelines.engine.store.pins import pin
from pipelines.engine.store.store import Row, Store
from schemas.base.errors import DamagedError
from schemas.base.model import canonical_json

Chain = Callable[..., list[Step]]


@pytest.fixture
def chain(package: Any) -> Chain:
    """first(film) -> second(first)."""
    join = package.step_module("join")

    def draw(film: bytes = b"film", scan: str = "P/S", second: str = join) -> list[Step]:
        return [
            Step(scan, "first", join, None, {"film": Value(film)}),
            Step(scan, "second", second, None, {"first": Output(f"{scan}/first"), "x": Value(b"x")}),
        ]

    return draw


def path(store: Store, name: str) -> Path:
    return Path(store.files.path(name))


def names(store: Store, folder: str) -> list[str]:
    return [name for name, _ in store.files.sizes(folder)]


def test_a_sound_store(chain: Chain, store: Store, run_steps: Any, caplog: pytest.LogCaptureFixture) -> None:
    run_steps(*chain())
    pin("P/S", store)
    with lease(store):
        count = len(names(store, ""))
        assert verify(store) == Audit(count, [])
    assert caplog.messages == []
    assert len(names(store, "")) == count - 1


@pytest.mark.parametrize(
    "damage", [lambda data: data[:0], lambda data: data[:-1], lambda data: bytes([data[0] ^ 1]) + data[1:]]
)
@pytest.mark.parametrize("folder", ["blobs", "actions", "latest"])
def test_each_damaged_file_is_said_once_and_removed_and_mended(
    chain: Chain, store: Store, run_steps: Any, caplog: pytest.LogCaptureFixture, folder: str, damage: Any
) -> None:
    outcomes, _ = run_steps(*chain())
    whole = {name: store.files.read(name) for name in names(store, "")}
    for name in names(store, folder):
        store.files.write(name, damage(whole[name]))
        with caplog.at_level(logging.WARNING):
            assert verify(store) == Audit(len(whole), [str(path(store, name))])
        assert caplog.messages == [f"{path(store, name)}: damaged, will be made again"]
        caplog.clear()
        assert not path(store, name).exists()
        assert verify(store) == Audit(len(whole) - 1, [])
        store.files.write(name, whole[name])
    assert run_steps(*chain()) == (outcomes, [])


def sealed(value: dict[str, Any]) -> bytes:
    return canonical_json({**value, "seal": sha256(canonical_json(value).encode())}).encode()


def test_files_made_by_hand_are_found(store: Store, caplog: pytest.LogCaptureFixture) -> None:
    store.record("P/S/x", Row({"step": "x", "code": "c" * 64, "parameters": None, "inputs": {}}, store.put(b"x")))
    key = key_of({"step": "y"})
    bad = {
        row_name(key): sealed({"image": {"step": "z"}, "digest": "a" * 64, "failure": None}),
        row_name("d" * 64): sealed({"image": {"step": "z"}, "digest": "../../x", "failure": None}),
        latest_name("P/S/y"): sealed({"step": "P/S/x", "key": key, "sources": {}}),
        latest_name("P/S/z"): sealed({"step": "P/S/z", "key": "../../x", "sources": {}}),
        "runs/h-1-ab.json": b"[]",
    }
    for name, data in bad.items():
        store.files.write(name, data)
    with caplog.at_level(logging.WARNING):
        assert set(verify(store).damaged) == {str(path(store, name)) for name in bad}
    assert len(caplog.messages) == len(bad)
    assert verify(store).files == 3


def test_a_damaged_pin_is_said_and_stays(
    chain: Chain, store: Store, run_steps: Any, caplog: pytest.LogCaptureFixture
) -> None:
    run_steps(*chain())
    pin("P/S", store)
    store.files.write("pins/P/S.json", b"{}")
    with caplog.at_level(logging.WARNING):
        assert verify(store).damaged == [str(path(store, "pins/P/S.json"))]
    assert len(caplog.messages) == 1
    assert path(store, "pins/P/S.json").exists()


def test_files_that_are_none_of_the_stores_are_let_be(store: Store) -> None:
    digest = store.put(b"x")
    for name in (
        "blobs/README",
        f"blobs/00/{digest}",
        f"blobs/{digest[:2]}/.x.1-2.partial",
        "actions/x.json",
        "latest/x",
    ):
        store.files.write(name, b"mine")
    assert verify(store) == Audit(6, [])
    assert path(store, "blobs/README").read_bytes() == b"mine"


def test_an_unreadable_blob_is_damaged(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    name = blob_name(store.put(b"x"))

    def read(_: object, name: str) -> bytes:
        raise OSError(5, "Input/output error", name)

    monkeypatch.setattr(type(store.files), "read", read)
    assert verify(store).damaged == [str(path(store, name))]


def repeated(steps: list[Step], store: Store) -> list[Difference | None]:
    return [repeat(action, store) for action in repeatable(make_plan(steps, store), store).values()]


def test_what_is_deterministic_is_reproduced(chain: Chain, store: Store, run_steps: Any) -> None:
    assert repeated(chain(), store) == []
    run_steps(*chain())
    before = {name: path(store, name).stat().st_mtime_ns for name in names(store, "")}
    assert repeated(chain(), store) == [None, None]
    assert {name: path(store, name).stat().st_mtime_ns for name in names(store, "")} == before


def test_what_is_not_is_found_with_both_digests(
    chain: Chain, package: Any, store: Store, run_steps: Any, tmp_path: Path
) -> None:
    hidden = tmp_path / "hidden"
    hidden.write_bytes(b"1")
    module = package.step_module(
        "sly", f"from pathlib import Path\ndef run(*_):\n    return Path({str(hidden)!r}).read_bytes()\n"
    )
    run_steps(*chain(second=module))
    assert repeated(chain(second=module), store) == [None, None]
    hidden.write_bytes(b"2")
    assert repeated(chain(second=module), store) == [None, Difference("P/S/second", sha256(b"1"), sha256(b"2"))]


def test_failures_are_repeated_too(chain: Chain, package: Any, store: Store, run_steps: Any, tmp_path: Path) -> None:
    hidden = tmp_path / "hidden"
    source = f"""
from pathlib import Path
from schemas.base.errors import Finding
def run(*_):
    if Path({str(hidden)!r}).exists():
        return b"found"
    raise Finding("no stripe")
"""
    steps = chain(second=package.step_module("sly", source))
    steps.append(Step("P/S", "behind", steps[0].module, None, {"second": Output("P/S/second")}))
    run_steps(*steps)
    assert repeated(steps, store) == [None, None]  # the second step has no action of its own
    hidden.touch()
    assert repeated(steps, store) == [None, Difference("P/S/second", "no stripe", sha256(b"found"))]


def test_only_what_has_its_inputs_is_repeated(chain: Chain, store: Store, run_steps: Any) -> None:
    outcomes, _ = run_steps(*chain())
    plan = make_plan(chain(), store)
    store.files.remove(blob_name(outcomes["first"].digest))
    assert [action.step.kind for action in repeatable(plan, store).values()] == ["first"]
    assert repeatable(make_plan(chain(), store), store) == {}
    [_, second] = repeatable(plan_with(chain(), store, run_steps), store).values()
    store.files.write(blob_name(outcomes["first"].digest), b"damaged")
    with pytest.raises(DamagedError, match="the result of P/S/first is damaged"):
        repeat(second, store)


def plan_with(steps: list[Step], store: Store, run_steps: Any) -> Any:
    run_steps(*steps)
    return make_plan(steps, store)


def test_equal_actions_of_two_scans_are_one(chain: Chain, store: Store, run_steps: Any) -> None:
    run_steps(*chain())
    run_steps(*chain(scan="P/T"))
    both = [*chain(), *chain(scan="P/T")]
    assert len(repeatable(make_plan(both, store), store)) == 2


def test_what_a_step_leaves_behind_is_not_written_over(
    package: Any, store: Store, run_steps: Any, tmp_path: Path
) -> None:
    film, array = tmp_path / "film.avi", tmp_path / "frames" / "cam1"
    film.write_bytes(b"frames")
    digest, state = FileDigests(tmp_path / "files.json").of(film)
    source = """
def run(inputs, parameters, places):
    places["array"].mkdir(parents=True, exist_ok=True)
    (places["array"] / "zarr.json").write_bytes(places["film"].read_bytes())
    return b"manifest"
"""
    taken = SourceFile(film, digest, ((film, state),))
    step = Step(
        "P/S", "ingest", package.step_module("ingest", source), None, {"film": taken},
        places={"film": film, "array": array}, writes=array / "zarr.json",
    )  # fmt: skip
    run_steps(step)
    (array / "zarr.json").write_bytes(b"as it is")
    assert repeated([step], store) == [None]
    assert (array / "zarr.json").read_bytes() == b"as it is"


def test_a_sample() -> None:
    keys = [f"{number:03}" for number in range(200)]
    chosen = sample(keys, 0.05, 1)
    assert len(chosen) == 10
    assert chosen < set(keys)
    assert sample(reversed(keys), 0.05, 1) == chosen
    assert sample(keys, 0.05, 2) != chosen
    assert sample(keys, 1.0, 1) == set(keys)
    assert len(sample(keys[:3], 0.05, 1)) == 1
    assert sample([], 0.05, 1) == set()
