"""A calibration from a capture as the list of its steps."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel

from footscan.frames.film import film_files
from pipelines.engine.actions.step import Input, Output, Step, Value
from pipelines.engine.files.file_digests import FileDigests
from pipelines.recordings.captures import RecordedCapture
from pipelines.scan import STEPS, source_files
from pipelines.version import SOFTWARE
from schemas.base.errors import RefusedInput
from schemas.base.model import canonical_json
from schemas.calibration import view_name
from schemas.mounting import CaptureCamera, mounting_of
from schemas.parameters.calibration import CaptureCalibrationParameters
from schemas.reference import Capture, ReferenceObject


@dataclass(frozen=True)
class CaptureInputs:
    """The inputs that the steps of a calibration take from a capture, recorded or yet to be filmed."""

    file: Path
    """Its capture.yaml."""
    document: Capture
    reference: ReferenceObject
    paths: Mapping[int, Path]
    """The film of each view, by its number as in `schemas.calibration.view_number`."""
    films: Mapping[int, Mapping[str, Input]]
    """Inputs of each view's stripe step: its `film`. For a capture yet to be filmed, `film` is the step that lists
    the digests of all films, and `file` the name of the camera's film."""
    names: list[str]
    """All files within the capture's folder: capture.yaml, the reference object, the films."""
    digests: Input
    """Digests of these files, by name."""


def recorded_inputs(capture: RecordedCapture, digests: FileDigests) -> CaptureInputs:
    """Make the inputs of the steps from a recorded capture.

    Raises
    ------
    RefusedInput
        Two cameras have the same film.
    """
    paths = {camera.view: capture.film(camera) for camera in capture.document.cameras}
    films: dict[int, dict[str, Input]] = {}
    cameras: dict[tuple[str, ...], int] = {}
    for camera, path in paths.items():
        frames = tuple(digests.of(file)[0] for file in film_files(path))
        other = cameras.setdefault(frames, camera)
        if other != camera:
            problem = f"has the same film as camera {view_name(other)}, expected its own"
            raise RefusedInput(capture.file, problem, field=f"camera {view_name(camera)}")
        films[camera] = {"film": source_files(path, digests)}
    digests_by_name = {file.relative_to(capture.folder).as_posix(): digests.of(file)[0] for file in capture.files}
    listed = Value(canonical_json(digests_by_name).encode())
    return CaptureInputs(capture.file, capture.document, capture.reference, paths, films, list(digests_by_name), listed)


def camera_steps(name: str, capture: CaptureInputs, parameters: CaptureCalibrationParameters) -> list[Step]:
    """Build the steps of each camera of a capture, and the step that finds the object's poses from all views.

    `name` is the name of the graph's scan; the kinds are `stripe`, `recognise` and `place`.
    """
    steps: list[Step] = []
    document = {"capture": capture.file}
    for camera in capture.document.cameras:
        film = {"film": capture.paths[camera.view], **document}
        stripe = _step(
            name,
            "stripe",
            "capture_stripe",
            parameters.extraction,
            capture.films[camera.view],
            camera.view,
            places=film,
        )
        views: dict[str, Input] = {
            "stripe": Output(stripe.name), "reference": _reference(capture), "camera": _camera(camera)
        }  # fmt: skip
        steps += [stripe, _step(name, "recognise", "recognise", None, views, camera.view)]
    inputs = {"reference": _reference(capture), **_views(name, capture)}
    return [*steps, _step(name, "place", "place", parameters.placement, inputs, places=document)]


def fit_steps(name: str, capture: CaptureInputs, parameters: CaptureCalibrationParameters, poses: str) -> list[Step]:
    """Build the steps that calibrate each camera alone, with the poses of the object from the step of kind `poses`."""
    return [
        _step(
            name, "fit", "fit", parameters.fit,
            {
                "poses": Output(f"{name}/{poses}"), "reference": _reference(capture),
                "camera": _camera(camera, capture.document.ahead_mm(camera)),
                "stripe": Output(f"{name}/stripe-{camera.view}"),
                "recognised": Output(f"{name}/recognise-{camera.view}"),
            },
            camera.view, places={"capture": capture.file},
        )
        for camera in capture.document.cameras
    ]  # fmt: skip


def calibration_steps(
    name: str, capture: CaptureInputs, parameters: CaptureCalibrationParameters, *, keep_going: bool = False
) -> list[Step]:
    """Build the steps from a capture's films to its calibration, the result of the last step, of kind `calibrate`.

    With `keep_going`, cameras that see the object from another side than they stand on are calibrated as well.
    """
    steps = camera_steps(name, capture, parameters)
    document = {"capture": capture.file}
    views = _views(name, capture)
    poses = "place"
    for kind in ("all-recognise", *(() if keep_going else ("own-side",))):
        inputs = {"poses": Output(f"{name}/{poses}"), **views}
        steps.append(_step(name, kind, kind.replace("-", "_"), None, inputs, places=document))
        poses = kind
    steps += fit_steps(name, capture, parameters, poses)
    about = {"files": capture.names, "reference": Path(capture.document.reference).name, "software": SOFTWARE}
    last_inputs: dict[str, Input] = {
        **{f"fit-{camera.view}": Output(f"{name}/fit-{camera.view}") for camera in capture.document.cameras},
        **views,
        "reference": _reference(capture),
        "digests": capture.digests,
        "about": Value(canonical_json(about).encode()),
    }
    return [*steps, _step(name, "calibrate", "calibrate", None, last_inputs)]


@dataclass
class CaptureOfScan:
    """The calibration of a scan, made from a capture by steps of the scan's own graph."""

    name: str
    """Name of the graph's scan."""
    capture: CaptureInputs
    steps: list[Step]
    """Steps from the capture's films to the parts of the calibration that the scan takes."""

    @classmethod
    def from_capture(cls, name: str, capture: CaptureInputs) -> "CaptureOfScan":
        """Build the calibration of the scan `name`; each part that a scan takes adds a step to `steps`."""
        return cls(name, capture, calibration_steps(name, capture, CaptureCalibrationParameters()))

    @property
    def source(self) -> Output:
        """Name and digest of the calibration."""
        name = {"name": Value(canonical_json(self.capture.file.parent.name).encode())}
        return self._part("calibration-source", "calibration_source", name)

    def camera(self, camera: int) -> Output:
        """The map of one camera; RefusedInput if the capture lacks the camera."""
        known = dict.fromkeys(one.id for one in self.capture.document.cameras)
        if camera not in known:
            problem = f"has no camera {camera}, expected one of {', '.join(map(str, known))}"
            raise RefusedInput(self.capture.file, problem, field="cameras")
        return self._part("camera-map", "camera_map", {"camera": Value(canonical_json(camera).encode())}, camera)

    def cameras(self, ids: frozenset[int]) -> Output:
        """The calibration with the maps of these cameras only."""
        return self._part("camera-maps", "camera_maps", {"cameras": Value(canonical_json(sorted(ids)).encode())})

    def _part(self, kind: str, module: str, selection: Mapping[str, Input], camera: int | None = None) -> Output:
        calibration = {"calibration": Output(f"{self.name}/calibrate")}
        step = _step(self.name, kind, module, None, {**calibration, **selection}, camera)
        self.steps.append(step)
        return Output(step.name)


def _step(
    name: str,
    kind: str,
    module: str,
    parameters: BaseModel | None,
    inputs: Mapping[str, Input],
    camera: int | None = None,
    *,
    places: Mapping[str, Path] | None = None,
) -> Step:
    return Step(name, kind, f"{STEPS}.{module}", parameters, inputs, camera, places or {})


def _views(name: str, capture: CaptureInputs) -> dict[str, Input]:
    views: dict[str, Input] = {}
    for camera in capture.document.cameras:
        views[f"stripe-{camera.view}"] = Output(f"{name}/stripe-{camera.view}")
        views[f"recognised-{camera.view}"] = Output(f"{name}/recognise-{camera.view}")
    return views


def _reference(capture: CaptureInputs) -> Value:
    return Value(canonical_json(capture.reference.model_dump(mode="json")).encode())


def _camera(camera: CaptureCamera, ahead_mm: float | None = None) -> Value:
    mounting = mounting_of(camera)
    content: dict[str, object] = {"id": camera.view, "mounting": [mounting.x, mounting.y, mounting.z]}
    if ahead_mm is not None:
        content["laser"] = [camera.id, camera.laser, ahead_mm]
    return Value(canonical_json(content).encode())
