"""Scanners that were assembled at home, beside the ideal one, with one calibration or two.

    .venv/bin/python -m benchmarks.assembly [FIRST COUNT [FOLDER [films]]]

Each scanner (`draw_assembled`) measures one foot three times: ideal, calibrated by its chart alone, and calibrated by
the chart and the film of the standard body. The baseline is the ideal scanner. Then each parameter of the laser planes
is compared with the truth, in its standard deviations. FOLDER keeps what came of each world. With `films` the feet are
filmed, and so is the body; without, cameras have stripe points with errors, and no pictures.
"""

import sys
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from footscan.calibration.models.laser_plane import MIDDLE_Z_MM, terms_of_plane
from footscan.calibration.travel.body import standard_body
from footscan.calibration.travel.fit import OF_CAMERA, OF_HEAD
from footscan.recordings.scans import read_scan
from footscan.virtual.worlds.chart import on_sheet
from footscan.virtual.worlds.draw import as_designed, draw_assembled
from footscan.virtual.worlds.machine import Machine, machine_of
from pipelines.engine.actions.step import Success
from pipelines.engine.pool import Pool, cores, local_cluster
from pipelines.engine.workspace import Workspace
from pipelines.worlds.campaign import run_worlds
from pipelines.worlds.graph import calibration_steps, film_step
from schemas.calibration import Calibration
from schemas.campaign import WorldKind, WorldOutcome
from schemas.parameters.scan import ScanParameters
from schemas.world import World

FIRST, COUNT = 1, 50


def main() -> None:
    numbers = [int(text) for text in sys.argv[1:3]] or [FIRST, COUNT]
    worlds = [draw_assembled(seed) for seed in range(numbers[0], numbers[0] + numbers[1])]
    kind: WorldKind = "films" if sys.argv[4:] == ["films"] else "points"
    with tempfile.TemporaryDirectory() as temporary:
        _compare(worlds, kind, Path(sys.argv[3] if len(sys.argv) > 3 else temporary))


def _compare(worlds: Sequence[World], kind: WorldKind, folder: Path) -> None:
    ideal = [as_designed(world) for world in worlds]
    parameters = ScanParameters()
    with local_cluster(cores()) as pool:
        runs = {
            "ideal scanner": run_worlds(ideal, kind, parameters, folder, pool, _show),
            "chart": run_worlds(worlds, kind, parameters, folder, pool, _show),
            "chart and body": run_worlds(worlds, kind, parameters, folder, pool, _show, standard_body()),
        }
        _compare_planes(worlds, kind, folder, pool)
    print(f"\n{len(worlds)} scanners; median (largest)")
    baseline = _means(runs["ideal scanner"])
    for name, outcomes in runs.items():
        lengths, ratios = np.abs(_errors(outcomes, "foot_length")), _means(outcomes) / baseline
        silent = sum(len(outcome.silent_errors) for outcome in outcomes)
        print(f"  {name:16} surface {_spread(_means(outcomes))} mm, ratio {_spread(ratios)}")
        print(f"  {'':16} foot length off by {_spread(lengths)} mm, {int(np.sum(lengths > 0.15))} beyond 0.15")
        print(f"  {'':16} errors of foot length", " ".join(f"{e:+.2f}" for e in _errors(outcomes, "foot_length")))
        print(f"  {'':16} silent errors {silent}")


def _compare_planes(worlds: Sequence[World], kind: WorldKind, folder: Path, pool: Pool) -> None:
    """Print how far each parameter of the laser planes lies from the truth, and how often within 3 of its sigmas."""
    errors: dict[str, list[float]] = defaultdict(list)
    sigmas: dict[str, list[float]] = defaultdict(list)
    with Workspace(folder / "cache") as workspace:
        for world in worlds:
            made = _calibrated(world, kind, folder, workspace, pool)
            for name, error, sigma in [] if made is None else _plane_errors(made, machine_of(world)):
                errors[name].append(error)
                sigmas[name].append(sigma)
    print("\nlaser planes, chart and body: error, median (largest); determined; within 3 sigma")
    for name, off in errors.items():
        error, sigma = np.abs(off), np.array(sigmas[name])
        known = sigma > 0
        within = np.mean(error[known] <= 3 * sigma[known]) if known.any() else np.nan
        shares = f"{100 * known.mean():.0f} %; {100 * within:.1f} %"
        print(f"  {name:16} {np.median(error):.5f} ({error.max():.5f}); {shares}")


def _calibrated(world: World, kind: WorldKind, folder: Path, workspace: Workspace, pool: Pool) -> Calibration | None:
    """Calibrate the scanner of a world by its chart and the body; None, and the reason is printed, if that fails."""
    film = None
    if kind == "films":
        filmed = film_step(world, folder / f"{world.seed}-body", standard_body())
        workspace.run([filmed], pool, lambda _: None)
        film = read_scan(filmed.places["folder"]), workspace.digests
    steps = calibration_steps(world, standard_body(), film)
    end = workspace.run(steps, pool, lambda _: None)[steps[-1].name]
    if isinstance(end, Success):
        return Calibration.model_validate_json(workspace.store.get(end.digest) or b"")
    print(f"  {world.seed}: {end.problem}")
    return None


def _plane_errors(made: Calibration, machine: Machine) -> list[tuple[str, float, float]]:
    """Name, error and standard deviation of each parameter: those of heads once a head, those of cameras once each."""
    planes = {camera.camera: camera.plane for camera in made.cameras if camera.plane is not None}
    firsts = {head: camera for camera, head in reversed(machine.head_of.items()) if camera in planes}
    truth = {head: _true_plane(machine, head, planes[camera].x_mm) for head, camera in firsts.items()}
    common = np.mean([true[0] for true in truth.values()])
    shutter = machine.world.cameras.rolling_shutter_ms / 1000.0 * machine.world.cameras.frames_per_second
    found = []
    for head, camera in firsts.items():
        plane, true = planes[camera], truth[head] - np.array([common, 0, 0, 0, 0])
        values = [plane.offset_mm, plane.yaw, plane.pitch, plane.bend_mm, plane.scale]
        found += list(zip(OF_HEAD, values - true, plane.sd, strict=False))
    for plane in planes.values():
        found += list(zip(OF_CAMERA, (plane.delay_frames, plane.shutter_frames - shutter), plane.sd[5:], strict=True))
    return found


def _true_plane(machine: Machine, head: int, x_mm: float) -> np.ndarray:
    """(5,) offset, yaw, pitch, bend and scale of a head, as in `LaserPlane`, by X of its sheet over the scan volume."""
    pose, scale = machine.calibration_pose(head), machine.world.heads[head].travel_scale
    y, z = (grid.ravel() for grid in np.meshgrid(np.linspace(-60.0, 60.0, 13), np.linspace(0.0, 2 * MIDDLE_Z_MM, 13)))
    on = on_sheet(np.column_stack([y, z]), pose, machine.world.laser.bend_mm)
    nothing = np.zeros(len(on))
    shape = np.linalg.lstsq(terms_of_plane(nothing, on[:, 1:], nothing, nothing, 0.0)[:, :4], on[:, 0], rcond=None)[0]
    return np.append(shape, scale) + np.array([scale * x_mm, 0.0, 0.0, 0.0, 0.0])


def _means(outcomes: Sequence[WorldOutcome]) -> np.ndarray:
    return np.array([np.nan if outcome.surface is None else outcome.surface.mean for outcome in outcomes])


def _errors(outcomes: Sequence[WorldOutcome], name: str) -> np.ndarray:
    found = [outcome.measures[name].error if name in outcome.measures else None for outcome in outcomes]
    return np.array([np.nan if error is None else error for error in found])


def _spread(values: np.ndarray) -> str:
    return f"{np.nanmedian(values):.3f} ({np.nanmax(values):.3f})"


def _show(outcome: WorldOutcome) -> None:
    print("!" if outcome.problem else ".", end="", flush=True)


if __name__ == "__main__":
    main()
