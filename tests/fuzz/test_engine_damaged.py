"""Whatever happens to the files of a store, the next run hands out nothing wrong, and mends what it needs.

FOOTSCAN_FUZZ=200 pytest tests/fuzz/test_engine_damaged.py      200 damaged stores instead of a few
FOOTSCAN_FUZZ_FIRST=41 FOOTSCAN_FUZZ=1 ...                      case 41 again
"""

import logging
import os
import time
from dataclasses import dataclass
from pathlib import Path
from random import Random

import pytest
from made_up_graph import (
    blob_path,
    is_sound,
    prepare,
    run_graph,
    sound_files,
    sound_rows,
    store_files,
    store_of,
    times_run,
)

from pipelines.engine.files import digest

ASKED = os.environ.get("FOOTSCAN_FUZZ")
FIRST = int(os.environ.get("FOOTSCAN_FUZZ_FIRST", "0"))
CASES = 12 if ASKED is None else int(ASKED)
EDITED = 1
"""Seed of the graph after a change in its middle."""


@dataclass(frozen=True)
class Undamaged:
    """What the graph comes to on a store that nothing happened to."""

    results: dict[str, str]
    reached: dict[str, bytes]
    """Rows and results, by the names of their files."""


@pytest.fixture(autouse=True)
def film_that_is_old(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its digest is remembered at once."""
    monkeypatch.setattr(digest, "SETTLED_NS", 0)


@pytest.fixture(scope="session")
def undamaged(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Undamaged]:
    """By seed."""
    found = {}
    for seed in (0, EDITED):
        folder = prepare(tmp_path_factory.mktemp("undamaged") / "run")
        results = run_graph(folder, pause_ms=0, seed=seed).results
        rows, blobs = store_files(folder, "actions"), store_files(folder, "blobs")
        names = [blob_path(row["digest"]) for row in sound_rows(folder).values() if row["digest"]]
        found[seed] = Undamaged(without_folder(results, folder), rows | {name: blobs[name] for name in names})
    return found


@pytest.mark.parametrize("number", range(FIRST, FIRST + CASES))
def test_damaged_store_is_mended(
    number: int, undamaged: dict[int, Undamaged], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    random = Random(f"damaged {number}")
    folder = prepare(tmp_path / "run")
    run_graph(folder, pause_ms=0)
    before = contents(folder)
    damaged: dict[str, bytes | None] = {}

    def damage() -> None:
        time.sleep(0.01)  # in file systems, time stands still for some ms: a change within them may go unseen
        for _ in range(random.choice((1, 1, 2, 3))):
            damage_a_file(random, folder)
        after = contents(folder)
        damaged.update({name: after.get(name) for name in before if after.get(name) != before[name]})

    seed, when = random.choice(((0, "before"), (0, "before"), (EDITED, "before"), (EDITED, "after the plan")))
    if when == "before":
        damage()
    with caplog.at_level(logging.WARNING, "footscan"):
        ran = run_graph(folder, pause_ms=0, seed=seed, after_plan=damage if when == "after the plan" else lambda: None)
        if ran.is_damaged or when == "after the plan":  # what happens behind a run's back is for the next one to see
            ran = run_graph(folder, pause_ms=0, seed=seed)
    check(folder, without_folder(ran.results, folder), undamaged, seed)
    reached = undamaged[seed].reached.keys()
    unnoticed = [name for name in damaged.keys() & reached if damaged[name] is not None and name not in caplog.text]
    assert not unnoticed

    times = times_run(folder)
    caplog.clear()
    run_graph(folder, pause_ms=0, seed=seed)
    assert times_run(folder) == times
    assert caplog.messages == []


def check(folder: Path, results: dict[str, str], undamaged: dict[int, Undamaged], seed: int) -> None:
    """Results are right; all that they reach is as it was written; what else is damaged is not handed out."""
    assert results == undamaged[seed].results
    after = contents(folder)
    for name, content in undamaged[seed].reached.items():
        assert after[name] == content
    known = {name for one in undamaged.values() for name in one.reached}
    assert set(sound_files(folder, "actions")) <= known, "an action with inputs that were never there"
    store = store_of(folder)
    for name, content in store_files(folder, "blobs").items():
        assert store.get(Path(name).name) == (content if is_sound(name, content) else None)


def damage_a_file(random: Random, folder: Path) -> None:
    """One file of the store, or of what is remembered of it, is no longer what it was."""
    names = sorted(contents(folder))
    kind = random.choice(sorted({name.split("/")[0] for name in names}))
    file, other = (place(folder, random.choice([name for name in names if name.startswith(kind)])) for _ in range(2))
    content = bytearray(file.read_bytes())
    act = random.choice(("flip", "flip", "flip", "truncate", "delete", "zero", "exchange"))
    if act == "flip":
        for _ in range(random.choice((1, 1, 1, 8))):
            if content:
                content[random.randrange(len(content))] ^= 1 << random.randrange(8)
    elif act == "truncate":
        del content[random.randrange(len(content) + 1) :]
    elif act == "zero":
        content[:] = bytes(len(content))
    elif act == "exchange":
        content[:] = other.read_bytes()
    if act == "delete":
        file.unlink()
    else:
        file.write_bytes(content)


def contents(folder: Path) -> dict[str, bytes]:
    """All files of the store, and of what is remembered of it."""
    remembered = [folder / "known.sqlite", folder / "files.json"]
    return store_files(folder, "") | {file.name: file.read_bytes() for file in remembered if file.exists()}


def place(folder: Path, name: str) -> Path:
    return folder / "store" / name if "/" in name else folder / name


def without_folder(results: dict[str, str], folder: Path) -> dict[str, str]:
    """Results, those of a film without where it lies."""
    return {kind: result.replace(str(folder), "") for kind, result in results.items()}
