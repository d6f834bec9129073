"""A graph that has all that graphs have, of steps that do little; and what its store must hold, read by other means.

python made_up_graph.py FOLDER      runs it in a process of its own, when told to by a line of input
"""

import hashlib
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import dask
import made_up_steps
from made_up_steps import Doing

from pipelines.engine.actions.code import code_identity
from pipelines.engine.actions.step import Failure, Output, SourceFile, Step, Value
from pipelines.engine.files.file_digests import FileDigests
from pipelines.engine.plan import make_plan
from pipelines.engine.pool import StepEnd, Threads
from pipelines.engine.run import run_plan
from pipelines.engine.store.store import Store, open_store

ROWS = 4
SIZES = (20, 3_000, 70_000, 900_000)
"""Bytes of results, by column: what is small is written at once, what is large takes a while."""


@dataclass(frozen=True)
class Ran:
    """What a run came to."""

    results: dict[str, str]
    """By kind of step: digest of the result, or the problem."""
    is_damaged: bool
    """Whether a step ended by something damaged; running again makes that anew."""


def main(folder: Path) -> None:
    """Run the graph when told to; all that it takes from then on is the engine's work."""
    dask.compute(dask.delayed(abs)(1), scheduler="threads")  # imports what it needs
    code_identity(made_up_steps.__name__)
    print("ready", flush=True)
    sys.stdin.readline()
    print(json.dumps(run_graph(folder).results), flush=True)


def prepare(folder: Path) -> Path:
    """A folder in which the graph can run."""
    (folder / "log").mkdir(parents=True)
    (folder / "film.avi").write_bytes(b"frames" * 1000)
    return folder


def run_graph(folder: Path, *, pause_ms: int = 2, seed: int = 0, after_plan: Callable[[], None] = lambda: None) -> Ran:
    """Plan and run the graph on the store in `folder`."""
    digests, store = FileDigests.load(folder / "files.json"), store_of(folder)
    memory = store.verified
    assert memory is not None
    steps = graph(folder, digests, pause_ms=pause_ms, seed=seed)
    plan = make_plan(steps, store)
    after_plan()

    def on_step_end(end: StepEnd) -> None:
        """An archive's run remembers at its end; here more often, so that it is interrupted in that, too."""
        if end.step.kind.endswith("0"):
            memory.save()

    try:
        outcomes = run_plan(plan, store, pool=Threads(2), on_step_end=on_step_end)
    finally:
        digests.save()
        memory.close()
    ends = {step.kind: outcomes[step.name] for step in steps}
    results = {kind: end.problem if isinstance(end, Failure) else end.digest for kind, end in ends.items()}
    return Ran(results, any(isinstance(end, Failure) and end.kind == "damaged" for end in ends.values()))


def store_of(folder: Path) -> Store:
    return open_store(folder / "store", folder / "known.sqlite")


def graph(folder: Path, digests: FileDigests, *, pause_ms: int, seed: int) -> list[Step]:
    """Rows of steps, each of two results of the row before; `seed` belongs to one in the middle.

    One step reads a film, one leaves a file behind, one finds nothing and fails what stands behind it.
    """
    film = folder / "film.avi"
    digest, state = digests.of(film)
    source = SourceFile(film, digest, ((film, state),))

    def step(kind: str, does: str, inputs: dict[str, Any], **more: Any) -> Step:
        size = SIZES[int(kind[-1]) % len(SIZES)]
        doing = Doing(does=does, size=size, pause_ms=pause_ms, seed=seed if kind == "mix-1-1" else 0)
        places = {"log": folder / "log" / kind, "film": film, "array": folder / "array.bin"}
        return Step("P/S", kind, made_up_steps.__name__, doing, inputs, places=places, **more)

    columns = range(len(SIZES))
    steps = [step(f"mix-0-{column}", "mix", {"value": Value(b"%d" % column)}) for column in columns]
    for row in range(1, ROWS):
        for column in columns:
            a, b = (Output(f"P/S/mix-{row - 1}-{c % len(SIZES)}") for c in (column, column + 1))
            steps.append(step(f"mix-{row}-{column}", "mix", {"a": a, "b": b}))
    return [
        *steps,
        step("read-1", "read", {"film": source}),
        step("write-2", "write", {"film": source}, writes=folder / "array.bin"),
        step("behind-3", "mix", {"a": Output("P/S/read-1"), "b": Output("P/S/write-2")}),
        step("find-0", "find", {"film": source}),
        step("behind-1", "mix", {"a": Output("P/S/find-0"), "b": Output("P/S/read-1")}),
    ]


def times_run(folder: Path) -> dict[str, int]:
    """How many times each step has begun, by kind."""
    return {log.name: log.stat().st_size for log in (folder / "log").iterdir()}


def complete_steps(folder: Path) -> set[str]:
    """Kinds of steps whose row is there, with its result."""
    return {row["image"]["step"] for row in sound_rows(folder).values() if is_complete(folder, row)}


def is_complete(folder: Path, row: dict[str, Any]) -> bool:
    digest = row["digest"]
    if row["image"]["step"].startswith("write") and not (folder / "array.bin").exists():
        return False
    return digest is None or f"blobs/{digest[:2]}/{digest}" in sound_files(folder, "blobs")


def sound_rows(folder: Path) -> dict[str, dict[str, Any]]:
    """The rows of actions, by file name."""
    return {name: json.loads(content) for name, content in sound_files(folder, "actions").items()}


def sound_files(folder: Path, kind: str) -> dict[str, bytes]:
    """Content of the files below `blobs`, `actions` or `latest` that are what they were written as, by name."""
    return {name: content for name, content in store_files(folder, kind).items() if is_sound(name, content)}


def store_files(folder: Path, kind: str) -> dict[str, bytes]:
    """Content of all of them, without those that were being written."""
    return {
        file.relative_to(folder / "store").as_posix(): file.read_bytes()
        for file in sorted((folder / "store" / kind).rglob("*"))
        if file.is_file() and not file.name.endswith(".partial")
    }


def is_sound(name: str, content: bytes) -> bool:
    """Whether a file of the store is what was written: a blob has its digest for a name, all others have a seal."""
    if name.startswith("blobs/"):
        return name == blob_path(hashlib.sha256(content).hexdigest())
    try:
        value = json.loads(content)
        seal = value.pop("seal")
    except (ValueError, KeyError, AttributeError, TypeError):
        return False
    return bool(seal == digest_of(value)) and (
        not name.startswith("actions/") or Path(name).stem == digest_of(value["image"])
    )


def blob_path(digest: str) -> str:
    return f"blobs/{digest[:2]}/{digest}"


def digest_of(value: Any) -> str:
    """Of a value's JSON, sorted and without spaces."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
