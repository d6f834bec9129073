"""The thesis beside us: its method and footscan's on the same films, as a whole and stage by stage."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.calibration.chart.chart import Chart, read_chart
from footscan.calibration.chart.from_chart import calibrate_chart
from footscan.calibration.models.maps import to_world
from footscan.calibration.travel.body import standard_body
from footscan.frames.film import open_film
from footscan.frames.reader import pixel_frames
from footscan.mesh.formats.files import read_file, read_mesh
from footscan.mesh.sampling import sample_surface
from footscan.recordings.scans import SCAN_FILE, read_scan
from footscan.report.thesis.page import stage_name
from footscan.report.thesis.reference_figure import reference_figure
from footscan.stripe.extract import extract_stripe
from footscan.surface.holes import perimeter, rims
from footscan.thesis.printed import BLOCK_MM, CLASSES, SCANNED_BLOCK_MM, WITHIN_MM
from footscan.thesis.reproduced import coefficients
from footscan.verify.compare import compare
from footscan.verify.distances import SearchedMesh
from footscan.virtual.filming.capture import capture_document
from footscan.virtual.stage.reference import standard_reference
from footscan.virtual.worlds.draw import draw_assembled
from pipelines.archive.job import CACHE, Job
from pipelines.archive.planning import plan_job
from pipelines.archive.running import run_job
from pipelines.block import beside_nominal, fit_block
from pipelines.demo import Watch
from pipelines.engine.actions.step import Failure, Outcome, Step, Success
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.digest import sha256
from pipelines.engine.pool import Pool, Threads
from pipelines.engine.workspace import Workspace, digests_by_kind
from pipelines.recordings.calibration_choice import CalibrationPlace
from pipelines.scan import STEPS
from pipelines.simulate import filmed_calibration_steps
from pipelines.version import SOFTWARE
from pipelines.worlds.graph import film_step, filmed_steps
from schemas.base.errors import Fault, Finding
from schemas.calibration import Calibration, Source, read_calibration
from schemas.campaign import WorldOutcome
from schemas.fits import CuboidParameters
from schemas.measures import Measures
from schemas.parameters.calibration import CalibrationParameters, CaptureCalibrationParameters
from schemas.parameters.demo import FilmedFoot
from schemas.parameters.scan import ScanParameters
from schemas.parameters.simulation import SimulationSettings
from schemas.thesis import (
    BlockDimension,
    ClickedCorners,
    FootMeasure,
    Method,
    ReconstructedFoot,
    Stage,
    StageOutcome,
    ThesisResult,
)

FOOT, BLOCK = FilmedFoot(patient="virtual", scan="foot"), FilmedFoot(patient="virtual", scan="block")
FIVE, ALL = CalibrationParameters(model="quadratic", points=5), CalibrationParameters(model="quadratic")
"""The calibration of the thesis, the quadratic (4.10, 4.11) through five clicked corners; and through all of them."""
CALIBRATIONS: dict[Stage, CalibrationParameters] = {"calibration": FIVE, "all-corners": ALL}
CORNERS = (5, 6, 8, 12, None)
"""Numbers of clicked corners that are compared."""
PRESET_STEPS: dict[Stage, tuple[str, ...]] = {
    "calibration": (), "all-corners": (), "extraction": ("extraction",), "outliers": ("outliers",),
    "fusion": ("heads", "fusion"), "surface": ("surface",),
}  # fmt: skip
"""The steps of the preset `thesis` in each stage; the calibration is no parameter of a scan."""
METHODS: tuple[Method, ...] = ("thesis", "thesis-all-corners", "footscan")
SAMPLES = 100_000
"""Points sampled on a surface to see which share of it is near the truth."""
OTHERS: tuple[Stage, ...] = ("extraction", "outliers", "fusion", "surface")
EXCHANGES: tuple[tuple[Stage, ...], ...] = (
    (),
    *((stage,) for stage in PRESET_STEPS),
    ("all-corners", *OTHERS),
    ("calibration", *OTHERS),
)
"""Stages whose method is the thesis's: none, one at a time, all."""
CHART = "capture/chart.csv"
"""Corners of the reference object as a person clicks them, within the folder."""
FIRST_SEED = 3001
"""Seed of the first world; on these worlds nothing was tuned."""


def run_thesis(folder: Path, worlds: int, pool: Pool, watch: Watch) -> ThesisResult:
    """Film block, foot and worlds into `folder`, and reconstruct them by each method; finished parts are kept.

    Raises
    ------
    Fault
        A step failed for a reason that is not the method's.
    """
    known = _film(folder, watch)
    for method in METHODS:
        _reconstruct(folder, method, pool, watch)
    stages = [outcome for k in range(worlds) for outcome in _exchanged(folder, FIRST_SEED + k, pool, watch)]
    rows = coefficients()
    return ThesisResult(
        coefficients=len(rows),
        agreeing=sum(row.agrees for row in rows),
        block=_block(folder),
        feet=[_foot(folder, method, known) for method in METHODS],
        corners=[_corners(read_chart(folder / CHART), count) for count in CORNERS],
        stages=stages,
    )


def calibration_file(folder: Path, method: Method) -> Path:
    """The calibration by one method."""
    return folder / f"calibration-{method}.json"


def scan_folder(folder: Path, film: FilmedFoot) -> Path:
    """The folder of a film."""
    return folder / "archive" / film.patient / film.scan


def results_folder(folder: Path, method: Method, film: FilmedFoot = FOOT) -> Path:
    """The results of a film by one method."""
    return folder / method / film.patient / film.scan


def _film(folder: Path, watch: Watch) -> dict[str, float]:
    """Film block, foot and reference object, calibrate by each method; returns the true measures of the foot."""
    steps = [
        _film_step("film", "simulate_scan", FOOT, folder),
        _film_step("film-block", "simulate_block", BLOCK, folder),
        *filmed_calibration_steps("thesis", folder / "capture", SimulationSettings()),
    ]
    with Workspace(folder / CACHE) as workspace:
        # The virtual scanner films on all cores by itself.
        digests = digests_by_kind(steps, _run(workspace, steps, Threads(1), watch, "films and calibration"))
        if problem := workspace.deliver({calibration_file(folder, "footscan").name: digests["calibrate"]}, folder):
            raise Fault(problem)
        known: dict[str, float] = json.loads(workspace.store.get(digests["film"]) or b"{}")
    fitted: dict[Method, CalibrationParameters] = {"thesis": FIVE, "thesis-all-corners": ALL}
    for method, parameters in fitted.items():
        clicked = _clicked(read_chart(folder / CHART), parameters, sha256((folder / CHART).read_bytes()))
        write_atomically(calibration_file(folder, method), (clicked.model_dump_json(indent=2) + "\n").encode())
    return known


def _film_step(kind: str, module: str, film: FilmedFoot, folder: Path) -> Step:
    place = scan_folder(folder, film)
    return Step("thesis", kind, f"{STEPS}.{module}", film, places={"folder": place}, writes=place / SCAN_FILE)


def _clicked(charts: Mapping[int, Chart], parameters: CalibrationParameters, digest: str) -> Calibration:
    source = Source(name=Path(CHART).name, sha256=digest)
    return calibrate_chart(charts, parameters=parameters, source=source, software=SOFTWARE)[0]


def _corners(charts: Mapping[int, Chart], count: int | None) -> ClickedCorners:
    """The quadratic through `count` corners of each camera, at all corners."""
    calibration = _clicked(charts, FIVE.model_copy(update={"points": count}), "0" * 64)
    away = np.concatenate(
        [
            np.linalg.norm(to_world(calibration.camera(camera), chart.pixels) - chart.world[:, 1:], axis=1)
            for camera, chart in charts.items()
        ]
    )
    return ClickedCorners(points=count, median_mm=float(np.median(away)), worst_mm=float(away.max()))


def _run(workspace: Workspace, steps: list[Step], pool: Pool, watch: Watch, part: str) -> dict[str, Outcome]:
    """Run steps; a failure that is neither a refusal nor a finding is raised."""
    plan = workspace.plan(steps)
    with watch(part, len(plan.to_run), len(plan.steps)) as on_step_end, workspace.lease():
        outcomes = workspace.run(steps, pool, on_step_end)
    for outcome in outcomes.values():
        if isinstance(outcome, Failure) and outcome.kind not in {"refused", "finding"}:
            raise Fault(outcome.problem)
    return outcomes


def _reconstruct(folder: Path, method: Method, pool: Pool, watch: Watch) -> None:
    """Reconstruct the foot and the block by one method; the block cannot be measured, and its cloud is delivered."""
    job = Job(
        folders=[scan_folder(folder, film) for film in (FOOT, BLOCK)],
        archives=(),
        calibrations=(CalibrationPlace(calibration_file(folder, method)),),
        calibration_wins=True,
        results=folder / method,
        cache=folder / method / CACHE,
        parameters=ScanParameters() if method == "footscan" else ScanParameters(preset="thesis"),
        threads=pool.count,
    )
    planned = plan_job(job)
    with watch(f"foot and block, method of {method}", planned.to_run, planned.steps) as on_step_end:
        for end in run_job(planned, pool, on_step_end):
            if end.problem is not None and end.kind != "finding":
                raise Fault(f"{end.scan}: {end.problem}")


def _block(folder: Path) -> list[BlockDimension]:
    """Table 6-1: as it is printed, and by each method."""
    found: dict[Method, list[float | None]] = {}
    for method in METHODS:
        try:
            fit = fit_block(results_folder(folder, method, BLOCK) / "cloud.ply", CuboidParameters())
        except Finding:
            found[method] = [None] * len(BLOCK_MM)
            continue
        found[method] = [dimension.value_mm for *_, dimension in beside_nominal(fit, BLOCK_MM)]
    return [
        BlockDimension(
            nominal_mm=nominal, printed_mm=printed, found_mm={method: found[method][k] for method in METHODS}
        )
        for k, (nominal, printed) in enumerate(zip(BLOCK_MM, SCANNED_BLOCK_MM, strict=True))
    ]


def _foot(folder: Path, method: Method, known: Mapping[str, float]) -> ReconstructedFoot:
    """Table 6-2: the foot by one method beside the truth."""
    results = results_folder(folder, method)
    measures = results / "measures.json"
    found = Measures.model_validate_json(measures.read_bytes()) if measures.exists() else None
    if not (results / "foot.stl").exists():
        problem = "no surface" if found is None else found.finding
        return ReconstructedFoot(method=method, problem=problem)
    vertices, faces = read_mesh(results / "foot.stl")
    truth = read_mesh(scan_folder(folder, FOOT) / "truth.stl")
    shape = vertices, faces
    searched = SearchedMesh(truth)
    comparison = compare(shape, truth, classes=CLASSES[0], both=True, searched_b=searched)
    few = compare(shape, truth, classes=CLASSES[1], searched_b=searched)
    away = np.abs(searched.signed_distances(sample_surface(vertices, faces, SAMPLES)))
    cloud = read_file(results / "cloud.ply")
    return ReconstructedFoot(
        method=method,
        comparison=comparison.model_copy(update={"histograms": [*comparison.histograms, *few.histograms]}),
        within_share=float(np.mean(away <= WITHIN_MM)),
        resolution_mm=_resolution_mm(cloud.vertices),
        holes_mm=sorted((round(perimeter(vertices[rim]), 1) for rim in rims(faces)), reverse=True),
        measures={
            name: FootMeasure(
                value=found.measures[name].value,
                truth=true,
                uncertainty=found.measures[name].uncertainty,
                status=found.measures[name].status,
            )
            for name, true in known.items()
            if found is not None and name in found.measures
        },
        problem=None if found is None else found.finding,
    )


def _resolution_mm(points: NDArray[np.float64]) -> float:
    """Median distance (mm) from a point to the nearest one."""
    return float(np.median(np.asarray(KDTree(points).query(points, 2)[0])[:, 1]))


def _exchanged(folder: Path, seed: int, pool: Pool, watch: Watch) -> Iterator[StageOutcome]:
    """Film a world, and reconstruct it with the stages of each of `EXCHANGES` by the method of the thesis."""
    world, body = draw_assembled(seed), standard_body()
    place = folder / "worlds" / str(seed)
    films = [film_step(world, place / "scan"), film_step(world, place / "body", body)]
    with Workspace(folder / CACHE) as workspace:
        _run(workspace, films, pool, watch, f"world {seed}, films")
        scan, shown = read_scan(place / "scan"), (read_scan(place / "body"), body)
        for stages in EXCHANGES:
            presets = [step for stage in stages for step in PRESET_STEPS[stage]]
            parameters = ScanParameters(preset=f"thesis:{','.join(presets)}") if presets else ScanParameters()
            clicked = next((CALIBRATIONS[stage] for stage in stages if stage in CALIBRATIONS), None)
            # The method of the thesis knows nothing of a body.
            body_film = shown if clicked is None else None
            steps = filmed_steps(world, scan, parameters, workspace.digests, body_film, clicked)
            outcomes = _run(workspace, steps, pool, watch, f"world {seed}, {stage_name(stages)}")
            yield _stage_outcome(seed, stages, outcomes[steps[-1].name], workspace)


def _stage_outcome(seed: int, stages: tuple[Stage, ...], end: Outcome, workspace: Workspace) -> StageOutcome:
    if not isinstance(end, Success):
        return StageOutcome(seed=seed, exchanged=stages, problem=end.problem)
    outcome = WorldOutcome.model_validate_json(workspace.store.get(end.digest) or b"")
    length, surface = outcome.measures.get("foot_length"), outcome.surface
    return StageOutcome(
        seed=seed,
        exchanged=stages,
        mean_mm=None if surface is None else surface.mean,
        p99_mm=None if surface is None else surface.p99,
        length_error_mm=None if length is None else length.error,
        length_status=None if length is None else length.status,
        problem=outcome.problem,
    )


def reference_png(folder: Path) -> bytes:
    """Figures 4-7 and 4-8 as PNG: the reference object in its first placement, by each calibration."""
    parameters = CaptureCalibrationParameters().extraction
    stripes = {}
    for camera in capture_document().cameras:
        frame = next(iter(pixel_frames(open_film(folder / "capture" / camera.file), [0])))
        assert frame is not None, "it was just filmed"
        points = extract_stripe(frame, parameters)
        stripes[camera.id] = np.column_stack([points["i"], points["j"]])
    clouds = {}
    names: dict[Method, str] = {"thesis": "five corners", "thesis-all-corners": "all corners", "footscan": "footscan"}
    for method, name in names.items():
        calibration = read_calibration(calibration_file(folder, method))
        clouds[name] = [to_world(calibration.camera(camera), pixels) for camera, pixels in stripes.items()]
    return reference_figure(np.asarray(standard_reference().profile_mm), clouds)
