"""Runs worlds and keeps what came of each; intermediate results of hundreds of worlds are not kept."""

import json
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

from footscan.virtual.worlds.draw import draw_world
from pipelines.arrays import unpack
from pipelines.engine.actions.key import image_text, key_of
from pipelines.engine.actions.step import Outcome, Output, SourceFile, Step, Success
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.pool import Pool
from pipelines.engine.workspace import Workspace
from pipelines.worlds.graph import world_steps
from schemas.base.errors import Fault, RefusedInput
from schemas.base.json_files import read_json
from schemas.campaign import WorldMeasure, WorldOutcome
from schemas.parameters.scan import ScanParameters

OUTCOMES = "outcomes"
"""Folder of what came of each world, by the key of its graph."""
WORLDS_AT_ONCE = 2
"""Worlds per worker whose intermediate results lie on the disk at once, about 0.1 GB each: a bound of space."""

OnWorld = Callable[[WorldOutcome], None]


def run_worlds(
    seeds: Sequence[int], parameters: ScanParameters, out: Path, pool: Pool, on_world: OnWorld
) -> list[WorldOutcome]:
    """Run the worlds of `seeds` without pictures, and return what came of each, in their order.

    A world whose code, parameters and description are those of an earlier run is not run again.

    Raises
    ------
    Fault
        A step failed for a reason that is not the world's: the disk, the memory, or a mistake in the program.
    """
    folder = out / OUTCOMES
    graphs = {seed: world_steps(draw_world(seed), parameters) for seed in seeds}
    files = {seed: folder / f"{graph_key(steps)}.json" for seed, steps in graphs.items()}
    outcomes: dict[int, WorldOutcome] = {}
    for seed, file in files.items():
        if (outcome := _read(file)) is not None:
            outcomes[seed] = outcome
            on_world(outcome)
    missing = iter([seed for seed in seeds if seed not in outcomes])
    while window := list(islice(missing, WORLDS_AT_ONCE * pool.count)):
        for seed, outcome in _run_window({seed: graphs[seed] for seed in window}, out, pool):
            write_atomically(files[seed], outcome.model_dump_json().encode())
            outcomes[seed] = outcome
            on_world(outcome)
    return [outcomes[seed] for seed in seeds]


def graph_key(steps: Sequence[Step]) -> str:
    """The key of a graph without source files: its steps' code, parameters and values; not their results."""
    keys: dict[str, str] = {}
    for step in steps:
        inputs: dict[str, str] = {}
        for name, source in step.inputs.items():
            assert not isinstance(source, SourceFile), "a world reads no files"
            inputs[name] = keys[source.step] if isinstance(source, Output) else source.digest
        keys[step.name] = key_of(image_text(step, inputs))
    return keys[steps[-1].name]


def _run_window(graphs: dict[int, list[Step]], out: Path, pool: Pool) -> Iterator[tuple[int, WorldOutcome]]:
    out.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix="worlds-", dir=out) as folder, Workspace(Path(folder)) as workspace:
        steps = [step for graph in graphs.values() for step in graph]
        ends = workspace.run(steps, pool, lambda _: None)
        for seed, graph in graphs.items():
            end = ends[graph[-1].name]
            if isinstance(end, Success):
                yield seed, WorldOutcome.model_validate_json(workspace.store.get(end.digest) or b"")
            elif end.kind in {"refused", "finding"}:
                yield seed, _refused(seed, end.problem, workspace, ends[graph[0].name])
            else:
                raise Fault(end.problem)


def _refused(seed: int, problem: str, workspace: Workspace, drawn: Outcome) -> WorldOutcome:
    covered: float = 0.0
    measures: dict[str, WorldMeasure] = {}
    if isinstance(drawn, Success):
        world = unpack(workspace.store.get(drawn.digest) or b"")
        covered = world["covered"].item()
        known: dict[str, float | None] = json.loads(world["measures"].tobytes())
        measures = {
            name: WorldMeasure(value=None, truth=truth, sigma=None, status="incomplete")
            for name, truth in known.items()
        }
    return WorldOutcome(seed=seed, kind="points", problem=problem, covered=covered, measures=measures)


def _read(file: Path) -> WorldOutcome | None:
    try:
        return read_json(file, WorldOutcome) if file.exists() else None
    except RefusedInput:  # a file that was cut off is made anew
        file.unlink(missing_ok=True)
        return None
