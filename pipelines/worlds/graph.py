"""A world as the list of its steps: from its seed to what came of it, without pictures or from films."""

from hashlib import sha256
from pathlib import Path

from pydantic import BaseModel

from footscan.recordings.scans import SCAN_FILE, RecordedScan
from footscan.virtual.worlds.film.record import PATIENT
from footscan.virtual.worlds.machine import HEAD_OF_CAMERA, machine_of
from pipelines.engine.actions.step import Input, Output, Step, Value
from pipelines.engine.files.file_digests import FileDigests
from pipelines.scan import STEPS, reconstruction_steps, scan_steps
from schemas.base.model import canonical_json
from schemas.campaign import WorldKind
from schemas.frames import FrameManifest
from schemas.parameters.calibration import CalibrationParameters
from schemas.parameters.scan import ScanParameters
from schemas.scan import Travel
from schemas.world import World

RESULTS = {"cleaned": "clean", "fused": "fuse", "oriented": "orient", "surface": "surface", "measures": "measure"}
"""Results of a reconstruction that are compared with the truth, and the kinds of their steps."""


class WorldGraph:
    """The steps of a world; also the calibration of its scanner, as the steps of a scan take it."""

    def __init__(self, world: World) -> None:
        """Begin with the steps that compute the world's truth and its chart, and calibrate from it."""
        self.world = world
        self.name = f"{PATIENT}/{world.seed}"
        self.steps: list[Step] = []
        self.drawn = self.add("world", "world_points", {}, world)
        self._calibration = self.add("calibration", "world_calibration", {"world": self.drawn}, CalibrationParameters())

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
        return self.add(
            "calibration-source", "calibration_source", {"calibration": self._calibration, "name": _value("")}
        )

    def camera(self, camera: int) -> Output:
        """The map of one camera."""
        inputs: dict[str, Input] = {"calibration": self._calibration, "camera": _value(camera)}
        return self.add("camera-map", "camera_map", inputs, None, camera)

    def cameras(self, ids: frozenset[int]) -> Output:
        """The calibration with the maps of these cameras only."""
        return self.add(
            "camera-maps", "camera_maps", {"calibration": self._calibration, "cameras": _value(sorted(ids))}
        )

    def compare(self, kind: WorldKind, results: dict[str, Input]) -> list[Step]:
        """Add the last step, of kind `outcome`, and return the steps that it needs."""
        self.add("outcome", "world_outcome", {"world": self.drawn, "kind": _value(kind), **results}, self.world)
        needed: set[str] = {self.steps[-1].name}
        kept = []
        for step in reversed(self.steps):
            if step.name in needed:
                kept.append(step)
                needed |= {source.step for source in step.inputs.values() if isinstance(source, Output)}
        return kept[::-1]


def point_steps(world: World, parameters: ScanParameters) -> list[Step]:
    """Build the steps of a world without pictures, in topological order; the last one compares with the truth."""
    graph, machine = WorldGraph(world), machine_of(world)
    points: dict[str, Input] = {}
    for camera in machine.cameras:
        head = HEAD_OF_CAMERA[camera]
        stripe = graph.add("stripe", "world_stripe", {"world": graph.drawn, "camera": _value(camera)}, None, camera)
        travel = Travel(start_mm=0.0, step_mm=machine.step_mm(head))
        mapped: dict[str, Input] = {
            "stripe": stripe,
            "manifest": _manifest(machine.frames(head), machine.size),
            "calibration": graph.camera(camera),
            "travel": _value(travel.model_dump(mode="json")),
        }
        points[f"points-{camera}"] = graph.add("map", "map_points", mapped, parameters.mapping, camera)
    maps = graph.cameras(frozenset(machine.cameras))
    made = reconstruction_steps(graph.name, points, maps, parameters, world.subject.side, graph.steps)
    return graph.compare("points", {name: getattr(made, name) for name in RESULTS})


def film_step(world: World, folder: Path) -> Step:
    """The step that films a world into a scan folder."""
    name = f"{PATIENT}/{world.seed}"
    return Step(
        name, "film", f"{STEPS}.world_film", world, places={"folder": folder}, writes=folder / SCAN_FILE
    )  # fmt: skip


def filmed_steps(world: World, scan: RecordedScan, parameters: ScanParameters, digests: FileDigests) -> list[Step]:
    """Build the steps from the films of a world to what came of it, in topological order."""
    graph = WorldGraph(world)
    made = scan_steps(scan, graph, parameters, digests)
    graph.steps += made
    results: dict[str, Input] = {name: Output(f"{graph.name}/{kind}") for name, kind in RESULTS.items()}
    return graph.compare("films", results)


def _value(content: object) -> Value:
    return Value(canonical_json(content).encode())


def _manifest(frames: int, size: tuple[int, int]) -> Value:
    """Frames that were never pictures: `map` takes their number from it."""
    digests: list[str | None] = [sha256(str(frame).encode()).hexdigest() for frame in range(frames)]
    manifest = FrameManifest(encoding="pixels", height=size[0], width=size[1], frames=digests)
    return _value(manifest.model_dump(mode="json"))
