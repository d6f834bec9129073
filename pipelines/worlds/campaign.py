"""Runs worlds and keeps what came of each; films and intermediate results of hundreds of worlds are not kept."""

import json
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

from footscan.calibration.travel.body import Body
from footscan.recordings.scans import read_scan
from pipelines.arrays import unpack
from pipelines.engine.actions.code import code_identity
from pipelines.engine.actions.key import image_text, key_of, parameters_text
from pipelines.engine.actions.step import Failure, Outcome, Output, SourceFile, Step, Success
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.pool import Pool
from pipelines.engine.workspace import Workspace
from pipelines.scan import STEPS
from pipelines.worlds.graph import film_step, filmed_steps, point_steps
from schemas.base.errors import Fault, RefusedInput
from schemas.base.json_files import read_json
from schemas.base.model import canonical_json
from schemas.campaign import WorldKind, WorldMeasure, WorldOutcome
from schemas.parameters.scan import ScanParameters
from schemas.world import World

OUTCOMES = "outcomes"
"""Folder of what came of each world, by its key."""
WORLDS_AT_ONCE = 2
"""Worlds per worker whose films and intermediate results lie on the disk at once, about 0.2 GB each: a bound of
space."""
OF_FILMS = ("ingest", "extract")
"""Steps of films that a world without pictures does not have."""

OnWorld = Callable[[WorldOutcome], None]


def run_worlds(
    worlds: Sequence[World],
    kind: WorldKind,
    parameters: ScanParameters,
    out: Path,
    pool: Pool,
    on_world: OnWorld,
    body: Body | None = None,
) -> list[WorldOutcome]:
    """Run worlds, whose seeds differ, and return what came of each, in their order.

    body : each scanner also films it, to calibrate where its laser planes lie; without it the chart is all there is.

    A world whose code, parameters and description are those of an earlier run is not run again.

    Raises
    ------
    Fault
        A step failed for a reason that is not the world's: the disk, or the memory.
    """
    files = {world.seed: out / OUTCOMES / f"{world_key(world, kind, parameters, body)}.json" for world in worlds}
    outcomes: dict[int, WorldOutcome] = {}
    for seed, file in files.items():
        if (outcome := _read(file)) is not None:
            outcomes[seed] = outcome
            on_world(outcome)
    missing = iter([world for world in worlds if world.seed not in outcomes])
    while window := list(islice(missing, WORLDS_AT_ONCE * pool.count)):
        for seed, outcome in _run_window(window, kind, parameters, out, pool, body):
            write_atomically(files[seed], outcome.model_dump_json().encode())
            outcomes[seed] = outcome
            on_world(outcome)
    return [outcomes[world.seed] for world in worlds]


def world_key(world: World, kind: WorldKind, parameters: ScanParameters, body: Body | None = None) -> str:
    """The key of what comes of a world: its description, the parameters, and the code of all steps."""
    steps = point_steps(world, parameters, body)
    if kind == "points":
        return graph_key(steps)
    codes = {name: code_identity(f"{STEPS}.{name}").digest for name in OF_FILMS}
    filmed = graph_key([film_step(world, Path())])
    values = {"points": graph_key(steps), "film": filmed, "codes": codes, "parameters": parameters_text(parameters)}
    return key_of(canonical_json(values))


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


def _run_window(
    worlds: Sequence[World],
    kind: WorldKind,
    parameters: ScanParameters,
    out: Path,
    pool: Pool,
    body: Body | None,
) -> Iterator[tuple[int, WorldOutcome]]:
    out.mkdir(parents=True, exist_ok=True)
    # A worker may still be writing when the last outcome is there.
    temporary = TemporaryDirectory(prefix="worlds-", dir=out, ignore_cleanup_errors=True)
    with temporary as folder, Workspace(Path(folder) / "cache") as workspace:
        graphs: dict[int, list[Step]] = {}
        if kind == "points":
            graphs = {world.seed: point_steps(world, parameters, body) for world in worlds}
        else:
            films = [film_step(world, Path(folder) / str(world.seed)) for world in worlds]
            bodies = (
                []
                if body is None
                else [film_step(world, Path(folder) / f"{world.seed}-body", body) for world in worlds]
            )
            _check(workspace.run([*films, *bodies], pool, lambda _: None))
            for number, world in enumerate(worlds):
                scan = read_scan(films[number].places["folder"])
                shown = None if body is None else (read_scan(bodies[number].places["folder"]), body)
                graphs[world.seed] = filmed_steps(world, scan, parameters, workspace.digests, shown)
        ends = workspace.run([step for graph in graphs.values() for step in graph], pool, lambda _: None)
        _check(ends)
        for seed, graph in graphs.items():
            end = ends[graph[-1].name]
            if isinstance(end, Success):
                yield seed, WorldOutcome.model_validate_json(workspace.store.get(end.digest) or b"")
            else:
                yield seed, _refused(seed, kind, end, workspace, ends[graph[0].name])


def _check(ends: dict[str, Outcome]) -> None:
    """Raise the first failure that is no refusal, no finding, and no defect of the program: the machine's."""
    for end in ends.values():
        if isinstance(end, Failure) and end.kind not in {"refused", "finding"} and not end.is_defect:
            raise Fault(end.problem)


def _refused(seed: int, kind: WorldKind, end: Failure, workspace: Workspace, drawn: Outcome) -> WorldOutcome:
    covered: float = 0.0
    measures: dict[str, WorldMeasure] = {}
    if isinstance(drawn, Success):
        world = unpack(workspace.store.get(drawn.digest) or b"")
        covered = world["covered"].item()
        known: dict[str, float | None] = json.loads(world["measures"].tobytes())
        nothing = WorldMeasure(value=None, truth=None, sigma=None, status="incomplete")
        measures = {name: nothing.model_copy(update={"truth": truth}) for name, truth in known.items()}
    return WorldOutcome(
        seed=seed, kind=kind, problem=end.problem, crashed=end.is_defect, covered=covered, measures=measures
    )


def _read(file: Path) -> WorldOutcome | None:
    try:
        return read_json(file, WorldOutcome) if file.exists() else None
    except RefusedInput:  # a file that was cut off is made anew
        file.unlink(missing_ok=True)
        return None
