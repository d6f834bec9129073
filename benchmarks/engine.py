"""What a warm step costs: the engine beside joblib.Memory and Hamilton's cache.

    .venv/bin/python -m benchmarks.engine

The two others come with `pip install -e '.[benchmarks]'`.
"""

import importlib
import json
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.compare import python, ratio_text, spread
from pipelines.engine.actions import code
from pipelines.engine.actions.key import image_text, key_of
from pipelines.engine.actions.step import Failure, Input, Output, SourceFile, Step, Success, Value
from pipelines.engine.files.digest import sha256
from pipelines.engine.plan import make_plan
from pipelines.engine.run import execute
from pipelines.engine.store.store import open_store
from pipelines.engine.workspace import Workspace
from schemas.parameters.scan import ScanParameters

ROUNDS = 5
SCANS, FEWER_SCANS = 500, 50
"""Of a graph for the engine alone, and of one for all engines."""

PACKAGE = "made_up"
MODULES = {"background": "ingest_background", "map": "map_points", "cloud": "cloud_ply", "stl": "foot_stl"}
"""Of the steps, by kind, where their names differ; a made-up step imports the real one, so that its code is as much."""


def _shape() -> dict[str, list[str]]:
    """The 40 steps of a scan of eight cameras, six with a background: what each takes, step, file, value or model."""
    steps: dict[str, list[str]] = {}
    cameras = range(1, 9)
    for n in cameras:
        steps[f"ingest_{n}"] = [f"film_{n}"]
        if n <= 6:
            steps[f"background_{n}"] = [f"ingest_{n}", f"off_{n}"]
        laser_off = [f"background_{n}"] if n <= 6 else []
        steps[f"extract_{n}"] = [f"ingest_{n}", *laser_off, "extraction_parameters"]
        steps[f"map_{n}"] = [f"extract_{n}", f"ingest_{n}", f"model_{n}", "travel", "mapping_parameters"]
    of_cameras = [f"{kind}_{n}" for kind in ("ingest", "extract") for n in cameras]
    return steps | {
        "fuse": [*(f"map_{n}" for n in cameras), "fusion_parameters"],
        "clean": ["fuse", "outliers_parameters"],
        "orient": ["clean", "normals_parameters"],
        "surface": ["orient", "surface_parameters"],
        "measure": ["surface"],
        "verify": ["surface", "truth"],
        "quality": ["clean", "surface", "verify", *of_cameras],
        "cloud": ["orient"],
        "stl": ["surface"],
        "report": ["orient", "surface", "measure", "quality", "verify", "about", *of_cameras],
    }


SHAPE = _shape()
GIVEN = sorted({name for taken in SHAPE.values() for name in taken} - SHAPE.keys())
"""What no step makes: files, values and parameters."""
MODELS = {f"{step}_parameters": getattr(ScanParameters(), step) for step in ScanParameters.model_fields}


def main() -> None:
    with tempfile.TemporaryDirectory() as place:
        compare_engines(Path(place), SCANS, FEWER_SCANS)


def compare_engines(place: Path, scans: int, fewer_scans: int) -> None:
    """Run all graphs once, then time them turn by turn, each in a process of its own."""
    write_package(place)
    runs = {
        "footscan, large": ("footscan", scans),
        "footscan": ("footscan", fewer_scans),
        "joblib, references": ("joblib_references", fewer_scans),
        "joblib, results": ("joblib_results", fewer_scans),
        "Hamilton, stores on disk": ("hamilton_disk", fewer_scans),
        "Hamilton, stores in memory": ("hamilton_memory", fewer_scans),
    }
    for name, (engine, size) in runs.items():
        folder = place / name
        if engine == "hamilton_memory":
            shutil.copytree(place / "Hamilton, stores on disk", folder)  # each round loads what one cold run has left
        else:
            found = in_process("prepare", engine, place, folder, size)
            print(f"{name}: {size * len(SHAPE)} steps run in {found['seconds']:.1f} s", flush=True)
    rounds: dict[str, list[dict[str, float]]] = {name: [] for name in runs}
    for _ in range(ROUNDS):
        for name, (engine, size) in runs.items():
            found = in_process("walk", engine, place, place / name, size)
            if found["ran"]:
                raise RuntimeError(f"{name}: {found['ran']} steps ran, expected none")
            rounds[name].append({what: 1e6 * seconds / (size * len(SHAPE)) for what, seconds in found["times"].items()})
    large = rounds.pop("footscan, large")
    print(f"\nWarm planning of {scans * len(SHAPE)} steps, microseconds a step: median (range) of {ROUNDS} processes")
    for what in large[0]:
        print(f"  {what:<44}{spread([found[what] for found in large])}")
    for what in ("first in its process", "again"):
        print(f"\nA warm graph of {fewer_scans * len(SHAPE)} steps, {what}, microseconds a step")
        baseline = np.array([found[what] for found in rounds["footscan"]])
        for name, each in rounds.items():
            times = [found[what] for found in each]
            ratio = "baseline" if name == "footscan" else ratio_text(np.array(times) / baseline)
            print(f"  {name:<32}{spread(times)}   {ratio}")


def in_process(task: str, *arguments: object) -> Any:
    """What `prepare` or `walk` returns in a new process."""
    call = f"import json; from benchmarks import engine; print(json.dumps(engine.{task}(*{[*map(str, arguments)]})))"
    # -B: no other trace of the made-up package than its own folder
    return json.loads(python("-B", "-c", call).splitlines()[-1])


def prepare(engine: str, package: str, folder: str, scans: str) -> dict[str, float]:
    """Run a graph for the first time: seconds, and how many steps ran."""
    walk_once = _engine(engine, package)
    start = time.perf_counter()
    ran = (_run_footscan if engine == "footscan" else walk_once)(Path(folder), int(scans))
    return {"seconds": time.perf_counter() - start, "ran": ran}


def walk(engine: str, package: str, folder: str, scans: str) -> dict[str, Any]:
    """Seconds of a warm walk through a graph, from opening the store: the first in this process, and another one."""
    walk_once = _engine(engine, package)
    times = {}
    for what in ("first in its process", "again"):
        start = time.perf_counter()
        ran = walk_once(Path(folder), int(scans))
        times[what] = time.perf_counter() - start
    if engine == "footscan":
        times |= _parts(Path(folder), int(scans))
    return {"times": times, "ran": ran}


def plan_once(engine: str, package: str, folder: str, scans: str, store: str) -> dict[str, float]:
    """Seconds of a plan in which nothing has to run, from opening the store until what was verified is saved.

    store : path or URL
    """
    _engine(engine, package)
    start = time.perf_counter()
    with Workspace(store if "://" in store else Path(store), Path(folder)) as workspace:
        if ran := len(workspace.plan(draw(int(scans))).to_run):
            raise RuntimeError(f"{ran} steps would run, expected none")
    return {"seconds": time.perf_counter() - start}


def _engine(name: str, package: str) -> Callable[[Path, int], int]:
    """A walk: of so many scans with a store in a folder; returns how many steps were no hits. Imports come first."""
    sys.path.insert(0, package)
    code.ROOMS = (*code.ROOMS, PACKAGE)
    if not name.startswith("footscan"):
        importlib.import_module("joblib" if name.startswith("joblib") else "hamilton.driver")
    return {
        "footscan": _walk_footscan,
        "joblib_references": partial(_walk_joblib, references=True),
        "joblib_results": partial(_walk_joblib, references=False),
        "hamilton_disk": partial(_walk_hamilton, in_memory=False),
        "hamilton_memory": partial(_walk_hamilton, in_memory=True),
    }[name]


def _walk_footscan(folder: Path, scans: int) -> int:
    store = open_store(folder / "store", folder / "known.sqlite")
    return len(make_plan(draw(scans), store).to_run)


def _walk_joblib(folder: Path, scans: int, *, references: bool) -> int:
    """As joblib's manual has it: a decorated function a node, its result or, shelved, a reference handed on."""
    import joblib

    nodes = importlib.import_module(f"{PACKAGE}.nodes")
    memory = joblib.Memory(folder, verbose=0)
    functions = {name: memory.cache(getattr(nodes, name)) for name in SHAPE}
    ran = len(nodes.RAN)
    for scan in range(scans):
        known = {name: _content(name, scan) for name in GIVEN}
        for name, taken in SHAPE.items():
            call = functions[name].call_and_shelve if references else functions[name]
            known[name] = call(*(known[one] for one in taken))
    return len(nodes.RAN) - ran


def _walk_hamilton(folder: Path, scans: int, *, in_memory: bool) -> int:
    """As Hamilton's manual has it: a function a node, one driver, which is executed for each scan's inputs.

    Stores in memory are loaded from those on disk, as in its section "In-memory caching".
    """
    from hamilton import driver
    from hamilton.caching.stores.file import FileResultStore
    from hamilton.caching.stores.memory import InMemoryMetadataStore, InMemoryResultStore
    from hamilton.caching.stores.sqlite import SQLiteMetadataStore

    nodes = importlib.import_module(f"{PACKAGE}.nodes")
    stores: dict[str, Any] = {"path": folder}
    if in_memory:
        metadata, results = SQLiteMetadataStore(path=folder), FileResultStore(path=folder)
        stores = {
            "metadata_store": InMemoryMetadataStore.load_from(metadata),
            "result_store": InMemoryResultStore.load_from(result_store=results, metadata_store=metadata),
        }
    dataflow = driver.Builder().with_modules(nodes).with_cache(**stores).build()
    ran = len(nodes.RAN)
    for scan in range(scans):
        inputs = {name: _content(name, scan) for name in GIVEN}
        dataflow.execute(["measure", "quality", "cloud", "stl", "report"], inputs=inputs)
    return len(nodes.RAN) - ran


def draw(scans: int) -> list[Step]:
    """The same graph as the engine's steps."""
    steps = []
    maps: dict[str, Input] = {name: _source(name, 0) for name in GIVEN if name.startswith("model_")}
    for scan in range(scans):
        known = maps | {name: _source(name, scan) for name in GIVEN if name not in MODELS | maps}
        for node, taken in SHAPE.items():
            kind, _, camera = node.partition("_")
            model = next((MODELS[one] for one in taken if one in MODELS), None)
            inputs = {one: known[one] for one in taken if one not in MODELS}
            step = Step(
                f"P{scan:04d}/S1", kind, f"{PACKAGE}.{kind}", model, inputs, int(camera) if camera else None,
                places={one: source.path for one, source in inputs.items() if isinstance(source, SourceFile)},
            )  # fmt: skip
            known[node] = Output(step.name)
            steps.append(step)
    return steps


def write_package(place: Path) -> None:
    """The trivial steps: a module a kind for the engine, a function a node for the others."""
    folder = place / PACKAGE
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text('"""Made up."""\n')
    for kind in {node.partition("_")[0] for node in SHAPE}:
        (folder / f"{kind}.py").write_text(
            f"from hashlib import sha256\n\nfrom pipelines.steps import {MODULES.get(kind, kind)} as real\n\n\n"
            "def run(inputs, parameters, places):\n"
            "    taken = [*(inputs[name] for name in sorted(inputs)), str(places).encode()]\n"
            "    return sha256(b''.join(taken)).hexdigest().encode()\n"
        )
    nodes = [
        "from hashlib import sha256\n\nRAN = []\n\n\n"
        "def _joined(*inputs):\n"
        "    RAN.append(1)\n"
        "    values = (one.get() if hasattr(one, 'args_id') else one for one in inputs)\n"
        "    return sha256(''.join(map(str, values)).encode()).hexdigest()\n"
    ]
    for node, taken in SHAPE.items():
        arguments = ", ".join(f"{one}: {'dict' if one in MODELS else 'str'}" for one in taken)
        nodes.append(f"def {node}({arguments}) -> str:\n    return _joined({', '.join(taken)})\n")
    (folder / "nodes.py").write_text("\n\n".join(nodes))


def _content(name: str, scan: int) -> Any:
    if name in MODELS:
        return MODELS[name].model_dump(mode="json")
    return sha256(f"{name} {0 if name.startswith('model_') else scan}".encode())


def _source(name: str, scan: int) -> Value | SourceFile:
    content = _content(name, scan)
    if name.startswith(("film", "off", "truth")):
        return SourceFile(Path(f"{content}.avi"), content, ())
    return Value(content.encode())


def _run_footscan(folder: Path, scans: int) -> int:
    store = open_store(folder / "store", folder / "known.sqlite")
    results: dict[str, str] = {}
    runs = 0
    for step in draw(scans):
        end = execute(step, _digests(step, results), store)
        if isinstance(end.outcome, Failure):
            raise RuntimeError(end.outcome.problem)
        results[step.name] = end.outcome.digest
        runs += end.ran
    assert store.verified is not None
    store.verified.close()
    return runs


def _parts(folder: Path, scans: int) -> dict[str, float]:
    """Seconds of the parts of a walk, one after the other."""
    clock = [time.perf_counter()]
    steps = draw(scans)
    clock.append(time.perf_counter())
    plan = make_plan(steps, open_store(folder / "store", folder / "known.sqlite"))
    clock.append(time.perf_counter())
    results = {p.step.name: p.outcome.digest for p in plan.steps if isinstance(p.outcome, Success)}
    inputs = [_digests(step, results) for step in steps]
    store = open_store(folder / "store", folder / "known.sqlite")
    clock.append(time.perf_counter())
    keys = [key_of(image_text(step, digests)) for step, digests in zip(steps, inputs, strict=True)]
    clock.append(time.perf_counter())
    for key in keys:
        store.lookup(key)
    clock.append(time.perf_counter())
    drawing, planning, _, of_keys, looking_up = np.diff(clock).tolist()
    return {
        "of this, drawing the steps": drawing,
        "building their keys": of_keys,
        "looking them up": looking_up,
        "the rest of planning": planning - of_keys - looking_up,
    }


def _digests(step: Step, results: Mapping[str, str]) -> dict[str, str]:
    return {
        name: results[source.step] if isinstance(source, Output) else source.digest
        for name, source in step.inputs.items()
    }


if __name__ == "__main__":
    main()
