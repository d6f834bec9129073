"""A world as the list of its steps: from its seed to what came of it, without pictures or from films."""

from hashlib import sha256
from pathlib import Path

from pydantic import BaseModel

from footscan.calibration.travel.body import Body
from footscan.recordings.scans import SCAN_FILE, RecordedScan
from footscan.virtual.worlds.film.record import PATIENT
from footscan.virtual.worlds.machine import Machine, machine_of
from pipelines.engine.actions.step import Input, Output, Step, Value, steps_to
from pipelines.engine.files.file_digests import FileDigests
from pipelines.scan import STEPS, reconstruction_steps, scan_steps
from pipelines.travel_job import body_value, heads_value, travel_steps
from schemas.base.model import canonical_json
from schemas.campaign import WorldKind
from schemas.frames import FrameManifest
from schemas.parameters.calibration import CalibrationParameters
from schemas.parameters.foot import MeasureParameters
from schemas.parameters.scan import ScanParameters
from schemas.scan import Travel
from schemas.world import World

RESULTS = {
    "heads": "heads",
    "cleaned": "clean",
    "fused": "fuse",
    "oriented": "orient",
    "surface": "surface",
    "measures": "measure",
}
"""Results of a reconstruction that are compared with the truth, and the kinds of their steps."""


class WorldGraph:
    """The steps of a world; also the calibration of its scanner, as the steps of a scan take it.

    Attributes
    ----------
    whole : the calibration.
    """

    def __init__(self, world: World, calibration: CalibrationParameters | None = None) -> None:
        """Begin with the steps that compute the world's truth and its chart, and calibrate from it."""
        self.world = world
        self.name = f"{PATIENT}/{world.seed}"
        self.steps: list[Step] = []
        self.drawn = self.add("world", "world_points", {}, world)
        fitted = calibration or CalibrationParameters()
        self.whole: Input = self.add("calibration", "world_calibration", {"world": self.drawn}, fitted)

    def add(
        self,
        kind: str,
        module: str,
        inputs: dict[str, Input],
        parameters: BaseModel | None = None,
        camera: int | None = None,
    ) -> Output:
        """Add a step."""
        self.steps.append(Step(self.name, kind, f"{STEPS}.{module}", parameters, inputs, camera))
        return Output(self.steps[-1].name)

    @property
    def source(self) -> Output:
        """Name and digest of the calibration."""
        return self.add("calibration-source", "calibration_source", {"calibration": self.whole, "name": _value("")})

    def camera(self, camera: int) -> Output:
        """The map of one camera."""
        inputs: dict[str, Input] = {"calibration": self.whole, "camera": _value(camera)}
        return self.add("camera-map", "camera_map", inputs, None, camera)

    def cameras(self, ids: frozenset[int]) -> Output:
        """The calibration with the maps of these cameras only."""
        return self.add("camera-maps", "camera_maps", {"calibration": self.whole, "cameras": _value(sorted(ids))})

    def film_body(self, machine: Machine, body: Body) -> None:
        """Add what a film of a body shows to the calibration, without pictures."""
        shape: dict[str, Input] = {"body": body_value(body)}
        filmed = self.add("body", "world_body", shape, self.world)
        planes: dict[str, Input] = {"calibration": self.whole, **shape, "heads": heads_value(_numbered_heads(machine))}
        for camera in machine.cameras:
            seen: dict[str, Input] = {"world": filmed, "camera": _value(camera)}
            planes[f"stripe-{camera}"] = self.add("body-stripe", "world_stripe", seen, None, camera)
            planes[f"manifest-{camera}"], planes[f"travel-{camera}"] = _frames(machine, camera)
        self.whole = self.add("planes", "laser_planes", planes)

    def read_body(self, film: RecordedScan, body: Body, digests: FileDigests) -> None:
        """Add what the film of a body shows to the calibration."""
        heads = _numbered_heads(machine_of(self.world))
        self.steps += travel_steps(film, self, heads, body, digests)
        self.whole = Output(self.steps[-1].name)

    def compare(self, kind: WorldKind, results: dict[str, Input]) -> list[Step]:
        """Add the last step, of kind `outcome`, and return the steps that it needs."""
        self.add("outcome", "world_outcome", {"world": self.drawn, "kind": _value(kind), **results}, self.world)
        return self.to_last()

    def to_last(self) -> list[Step]:
        """Return the last step and those that it needs."""
        return steps_to(self.steps, [self.steps[-1].name])


def calibration_steps(world: World, body: Body, film: tuple[RecordedScan, FileDigests] | None = None) -> list[Step]:
    """Build the steps to the calibration by a world's chart and a body, the result of the last step.

    film : of the body; without it, the body is seen without pictures.
    """
    graph = WorldGraph(world)
    if film is None:
        graph.film_body(machine_of(world), body)
    else:
        graph.read_body(film[0], body, film[1])
    return graph.to_last()


def point_steps(world: World, parameters: ScanParameters, body: Body | None = None) -> list[Step]:
    """Build the steps of a world without pictures, in topological order; the last one compares with the truth.

    body : is filmed to calibrate, after the chart.
    """
    graph, machine = WorldGraph(world), machine_of(world)
    if body is not None:
        graph.film_body(machine, body)
    points: dict[str, Input] = {}
    for camera in machine.cameras:
        stripe = graph.add("stripe", "world_stripe", {"world": graph.drawn, "camera": _value(camera)}, None, camera)
        manifest, travel = _frames(machine, camera)
        mapped: dict[str, Input] = {
            "stripe": stripe,
            "manifest": manifest,
            "calibration": graph.camera(camera),
            "travel": travel,
        }
        points[f"points-{camera}"] = graph.add("map", "map_points", mapped, parameters.mapping, camera)
    maps = graph.cameras(frozenset(machine.cameras))
    foot = MeasureParameters(side=world.subject.side)
    passes = {camera: machine.pass_number(head) for camera, head in machine.head_of.items()}
    later = {camera: number for camera, number in passes.items() if number > 1}
    made = reconstruction_steps(graph.name, points, maps, parameters, foot, graph.steps, passes=later)
    return graph.compare("points", {name: getattr(made, name) for name in RESULTS})


def film_step(world: World, folder: Path, body: Body | None = None) -> Step:
    """The step that films a world into a scan folder: its subject, or else the body to calibrate with."""
    name = f"{PATIENT}/{world.seed}"
    inputs: dict[str, Input] = {} if body is None else {"body": body_value(body)}
    return Step(
        name,
        "film" if body is None else "film-body",
        f"{STEPS}.world_film",
        world,
        inputs,
        places={"folder": folder},
        writes=folder / SCAN_FILE,
    )


def filmed_steps(
    world: World,
    scan: RecordedScan,
    parameters: ScanParameters,
    digests: FileDigests,
    body: tuple[RecordedScan, Body] | None = None,
    calibration: CalibrationParameters | None = None,
) -> list[Step]:
    """Build the steps from the films of a world to what came of it, in topological order.

    body : film of a body, and the body, to calibrate after the chart.
    calibration : of the chart; None for the defaults.
    """
    graph = WorldGraph(world, calibration)
    if body is not None:
        graph.read_body(*body, digests)
    made = scan_steps(scan, graph, parameters, digests)
    graph.steps += made
    results: dict[str, Input] = {name: Output(f"{graph.name}/{kind}") for name, kind in RESULTS.items()}
    return graph.compare("films", results)


def _numbered_heads(machine: Machine) -> dict[int, int]:
    """The head of each camera; calibrations count heads from 1."""
    return {camera: head + 1 for camera, head in machine.head_of.items()}


def _value(content: object) -> Value:
    return Value(canonical_json(content).encode())


def _frames(machine: Machine, camera: int) -> tuple[Input, Input]:
    """Manifest and travel of a camera's frames."""
    head = machine.head_of[camera]
    travel = Travel(start_mm=0.0, step_mm=machine.step_mm(head))
    return _manifest(machine.frames(head), machine.size), _value(travel.model_dump(mode="json"))


def _manifest(frames: int, size: tuple[int, int]) -> Value:
    """Frames that were never pictures: `map` takes their number from it."""
    digests: list[str | None] = [sha256(str(frame).encode()).hexdigest() for frame in range(frames)]
    manifest = FrameManifest(encoding="pixels", height=size[0], width=size[1], frames=digests)
    return _value(manifest.model_dump(mode="json"))
