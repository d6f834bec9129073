"""A world without pictures as the list of its steps: from its seed to what came of it."""

from hashlib import sha256

from footscan.virtual.worlds.machine import HEAD_OF_CAMERA, machine_of
from pipelines.engine.actions.step import Input, Output, Step, Value
from pipelines.scan import STEPS, reconstruction_steps
from schemas.base.model import canonical_json
from schemas.frames import FrameManifest
from schemas.parameters.calibration import CalibrationParameters
from schemas.parameters.scan import ScanParameters
from schemas.scan import Travel
from schemas.world import World

OUTCOME = "outcome"
"""Kind of the last step."""


def world_steps(world: World, parameters: ScanParameters) -> list[Step]:
    """Build the steps of a world, in topological order; the last one, of kind `outcome`, compares with the truth."""
    name = f"worlds/{world.seed}"
    steps: list[Step] = []

    def add(
        kind: str, module: str, inputs: dict[str, Input], parameters: object = None, camera: int | None = None
    ) -> Output:
        step = Step(name, kind, f"{STEPS}.{module}", parameters, inputs, camera)  # type: ignore[arg-type]
        steps.append(step)
        return Output(step.name)

    machine = machine_of(world)
    drawn = add("world", "world_points", {}, world)
    calibration = add("calibration", "world_calibration", {"world": drawn}, CalibrationParameters())
    points: dict[str, Input] = {}
    for camera in machine.cameras:
        number = _value(camera)
        head = HEAD_OF_CAMERA[camera]
        stripe = add("stripe", "world_stripe", {"world": drawn, "camera": number}, None, camera)
        own_map = add("camera-map", "camera_map", {"calibration": calibration, "camera": number}, None, camera)
        travel = Travel(start_mm=0.0, step_mm=machine.step_mm(head))
        mapped: dict[str, Input] = {
            "stripe": stripe,
            "manifest": _manifest(machine.frames(head), machine.size),
            "calibration": own_map,
            "travel": _value(travel.model_dump(mode="json")),
        }
        points[f"points-{camera}"] = add("map", "map_points", mapped, parameters.mapping, camera)
    maps = add("camera-maps", "camera_maps", {"calibration": calibration, "cameras": _value(sorted(machine.cameras))})
    made = reconstruction_steps(name, points, maps, parameters, world.subject.side, steps)
    compared: dict[str, Input] = {
        "world": drawn, "oriented": made.oriented, "surface": made.surface, "measures": made.measures
    }  # fmt: skip
    add(OUTCOME, "world_outcome", compared, world)
    return steps


def _value(content: object) -> Value:
    return Value(canonical_json(content).encode())


def _manifest(frames: int, size: tuple[int, int]) -> Value:
    """Frames that were never pictures: `map` takes their number from it."""
    digests: list[str | None] = [sha256(str(frame).encode()).hexdigest() for frame in range(frames)]
    manifest = FrameManifest(encoding="pixels", height=size[0], width=size[1], frames=digests)
    return _value(manifest.model_dump(mode="json"))
