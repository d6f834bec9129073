"""A scan as the list of its steps."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import NamedTuple, Protocol, Self, get_args

from footscan.frames.film import film_files
from footscan.frames.travel import read_positions
from footscan.recordings.calibration_checks import checks_of
from footscan.recordings.decisions import Decisions, decisions_of
from footscan.recordings.scans import RecordedScan
from footscan.sizing.table import read_table
from pipelines.engine.actions.key import parameters_text
from pipelines.engine.actions.step import Input, Output, SourceFile, Step, Value
from pipelines.engine.files.digest import sha256
from pipelines.engine.files.file_digests import FileDigests
from schemas.base.json_files import read_text
from schemas.base.model import Document, Posture, Side, canonical_json
from schemas.calibration import Calibration, calibration_from_json, maps_to_json
from schemas.calibration_check import CalibrationCheck, ScanCheck
from schemas.choices import ExportFormat
from schemas.measures import Axis
from schemas.parameters.delivery import ExportParameters, SizesParameters
from schemas.parameters.foot import FootParameters, MeasureParameters
from schemas.parameters.scan import ScanParameters
from schemas.scan import CameraFilm
from schemas.sizes import People
from schemas.used_calibration import UsedCalibration

STEPS = "pipelines.steps"
"""Package of the steps' modules; they are imported when they run, because a plan needs none of their libraries."""
DELIVERED = {
    "cloud.ply": "cloud.ply",
    "foot.stl": "foot.stl",
    "foot.ply": "foot.ply",
    "measures.json": "measure",
    "sizes.json": "sizes.json",
    "quality.json": "quality.json",
    "report.html": "report",
}
"""The files of a scan's results, and the kind of step that makes each."""
EXPORTED = {name: name for name in (f"foot.{suffix}" for suffix in get_args(ExportFormat))}
"""Likewise, of files in further formats, which are made where they are asked for."""
DELIVERABLE = DELIVERED | EXPORTED
SHOWN = ("measures.json", "sizes.json", "quality.json", "foot.ply")
"""Files that the operator's page of a foot is made from."""


class ScanCalibration(Protocol):
    """The parts of a calibration that the steps of a scan take."""

    @property
    def source(self) -> Input:
        """Name, digest and origin of the calibration, a `UsedCalibration`."""

    def camera(self, camera: int) -> Input:
        """The maps of one camera, one for each laser that it sees; RefusedInput if there is none."""

    def cameras(self, ids: frozenset[int]) -> Input:
        """The calibration with the maps of these cameras only."""


@dataclass(frozen=True)
class CalibrationFile:
    """A calibration, its file and the digest of the file."""

    path: Path
    content: Calibration
    digest: str
    checks: tuple[CalibrationCheck, ...] = ()
    """Checks of it that lie beside its file, the earliest first."""
    _parts: dict[object, Value] = field(default_factory=dict, compare=False, repr=False)
    """Cached parts that scans take: many scans take the same ones, and they are slow to serialise."""

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a calibration and its checks; RefusedInput if one of them is missing, damaged or of another format."""
        text = read_text(path, "json_bytes")
        digest = sha256(text.encode())
        return cls(path, calibration_from_json(text, path), digest, tuple(checks_of(path, digest)))

    @property
    def source(self) -> Value:
        """Name, digest and origin of the calibration."""
        made = self.content
        used = UsedCalibration(name=self.path.name, sha256=self.digest, created=made.created, software=made.software)
        return self._cached("source", lambda: _text(used))

    @property
    def whole(self) -> Value:
        """All of it."""
        return self._cached("whole", lambda: _text(self.content))

    def camera(self, camera: int) -> Value:
        """The maps of one camera; RefusedInput if there is none."""
        return self._cached(camera, lambda: maps_to_json(self.content.maps(camera, self.path)))

    def cameras(self, ids: frozenset[int]) -> Value:
        """The calibration with the maps of these cameras only."""
        maps = [camera for camera in self.content.cameras if camera.camera in ids]
        return self._cached(ids, lambda: _text(self.content.model_copy(update={"cameras": maps})))

    def _cached(self, part: object, make: Callable[[], str]) -> Value:
        if part not in self._parts:
            self._parts[part] = Value(make().encode(), self.path)
        return self._parts[part]


@dataclass(frozen=True)
class Wanted:
    """What a workflow wants of each scan beyond its results."""

    exports: tuple[ExportFormat, ...] = ()
    """Formats in which the mesh is delivered as well."""
    size_table: Path | None = None
    """Table of sizes; default: the built-in one."""

    @cached_property
    def sizes(self) -> Value:
        """The table of sizes as the input of a step; RefusedInput if it breaks its format."""
        return Value(_text(read_table(self.size_table)).encode(), self.size_table)


ORDINARY = Wanted()


def scan_steps(
    scan: RecordedScan,
    calibration: ScanCalibration,
    parameters: ScanParameters,
    digests: FileDigests,
    check: ScanCheck | None = None,
    wanted: Wanted = ORDINARY,
) -> list[Step]:
    """Build the steps from a scan's films to its results, in topological order.

    `check` is what the last check of the calibration before the scan says of its cameras; None without one.

    Raises
    ------
    RefusedInput
        A film, a background, a file of positions or the truth is missing, the calibration lacks a camera, or what was
        decided for the scan breaks its format.
    """
    steps: list[Step] = []
    decided = decisions_of(scan)
    choices = decided.choices

    def add(step: Step) -> Output:
        steps.append(step)
        return Output(step.name)

    cameras = [_camera_steps(scan, camera, calibration, parameters, digests, add) for camera in scan.document.cameras]
    manifests = {f"manifest-{camera.id}": camera.manifest for camera in cameras}
    stripes = {f"stripe-{camera.id}": camera.stripe for camera in cameras}
    points: dict[str, Input] = {f"points-{camera.id}": camera.points for camera in cameras}
    colours = {f"colours-{camera.id}": camera.colours for camera in cameras if camera.colours is not None}
    maps = calibration.cameras(frozenset(camera.id for camera in scan.document.cameras))
    foot = _foot_parameters(scan.document.side)
    posture = choices.posture or scan.document.posture
    measured = _measure_parameters(scan.document.side, posture, choices.axis or "toe2")
    heads, cleaned, fused, oriented, mesh, measures = reconstruction_steps(
        scan.name,
        points,
        maps,
        parameters,
        measured,
        steps,
        None if check is None else check.doubt,
        _landmarks(decided),
        scan.document.later_passes,
    )
    verified: dict[str, Output] = {}
    if (truth := scan.truth) is not None:
        pair: dict[str, Input] = {"surface": mesh, "truth": source_files(truth, digests)}
        verified = {"verified": add(Step(scan.name, "verify", f"{STEPS}.verify", None, pair, places={"truth": truth}))}
    quality_inputs: dict[str, Input] = {
        "heads": heads, "clean": cleaned, "fused": fused, "surface": mesh, "calibration": calibration.source,
        **manifests, **stripes, **verified,
    }  # fmt: skip
    if check is not None:
        quality_inputs["calibration-check"] = _document(check, scan.file)
    figures = add(Step(scan.name, "quality", f"{STEPS}.quality", None, quality_inputs))
    drawn: dict[str, Input] = {"clean": cleaned, **points, **manifests, **stripes}
    arrays = {f"array-{camera.id}": camera.array for camera in cameras}
    pictures = add(Step(scan.name, "pictures", f"{STEPS}.pictures", None, drawn, places=arrays))
    judged: dict[str, Input] = {"clean": cleaned, "fused": fused, "surface": mesh}
    deviations = add(Step(scan.name, "deviations", f"{STEPS}.deviations", None, judged))
    shoes = _sizes_parameters(choices.people, tuple(choices.systems))
    found_sizes: dict[str, Input] = {"measures": measures, "table": wanted.sizes}
    sizes = add(Step(scan.name, "sizes.json", f"{STEPS}.sizes_json", shoes, found_sizes))
    warned: dict[str, Input] = {"quality": figures, "measures": measures}
    recorded = {} if scan.recording is None else {"recording": scan.recording}
    warned |= {name: source_files(file, digests) for name, file in recorded.items()}
    quality = add(Step(scan.name, "quality.json", f"{STEPS}.quality_json", None, warned, places=recorded))
    add(Step(scan.name, "cloud.ply", f"{STEPS}.cloud_ply", None, {"oriented": oriented}))
    add(Step(scan.name, "foot.stl", f"{STEPS}.foot_stl", foot, {"surface": mesh}))
    ply_inputs: dict[str, Input] = {"surface": mesh, "name": _name(scan)}
    if colours:
        texture_inputs: dict[str, Input] = {
            "surface": mesh, "calibration": maps, "heads": heads, **points, **colours
        }  # fmt: skip
        ply_inputs["texture"] = add(Step(scan.name, "texture", f"{STEPS}.texture", None, texture_inputs))
    ply = add(Step(scan.name, "foot.ply", f"{STEPS}.foot_ply", foot, ply_inputs))
    for suffix in sorted({*wanted.exports, *choices.exports}):
        export = ExportParameters(side=scan.document.side, export_format=suffix)
        add(Step(scan.name, f"foot.{suffix}", f"{STEPS}.exported", export, {"foot.ply": ply}))
    report_inputs: dict[str, Input] = {
        "oriented": oriented, "surface": mesh, "pictures": pictures, "deviations": deviations, "measures": measures,
        "quality": quality, "sizes": sizes, "calibration": maps, "about": _about(scan, parameters), **verified,
    }  # fmt: skip
    if choices.notes:
        report_inputs["notes"] = Value(canonical_json(choices.notes).encode(), decided.choices_file)
    add(Step(scan.name, "report", f"{STEPS}.report", foot, report_inputs))
    return steps


class Reconstruction(NamedTuple):
    """The results of the steps from world points to measures."""

    heads: Output
    cleaned: Output
    fused: Output
    oriented: Output
    surface: Output
    measures: Output


def reconstruction_steps(
    name: str,
    points: Mapping[str, Input],
    maps: Input,
    parameters: ScanParameters,
    foot: MeasureParameters,
    steps: list[Step],
    calibration_doubt: str | None = None,
    landmarks: Value | None = None,
    passes: Mapping[int, int] | None = None,
) -> Reconstruction:
    """Add to `steps` those from the world points of all cameras, `points-N`, to measures.

    `name` is the name of the graph's scan, `maps` the calibration of its cameras, `calibration_doubt` a reason not to
    rely on it, `landmarks` those that a person has set, `passes` the number of the pass of each camera that did not
    film in the first one.
    """

    def add(kind: str, own: Document, inputs: Mapping[str, Input]) -> Output:
        files = {"landmarks": file} if kind == "measure" and landmarks and (file := landmarks.path) else {}
        steps.append(Step(name, kind, f"{STEPS}.{kind}", own, inputs, places=files))
        return Output(steps[-1].name)

    heads = add("heads", parameters.heads, {**points, "calibration": maps})
    clean_inputs: dict[str, Input] = {**points, "calibration": maps, "heads": heads}
    if passes:
        clean_inputs["passes"] = Value(canonical_json(passes).encode())
    cleaned = add("clean", parameters.outliers, clean_inputs)
    fused = add("fuse", parameters.fusion, {"clean": cleaned})
    oriented = add("orient", parameters.normals, {"fused": fused, "calibration": maps})
    surface = add("surface", parameters.surface, {"oriented": oriented})
    measure_inputs: dict[str, Input] = {"surface": surface, "fused": fused, "clean": cleaned, "heads": heads}
    if calibration_doubt is not None:
        measure_inputs["calibration-doubt"] = Value(canonical_json(calibration_doubt).encode())
    if landmarks is not None:
        measure_inputs["landmarks"] = landmarks
    measures = add("measure", foot, measure_inputs)
    return Reconstruction(heads, cleaned, fused, oriented, surface, measures)


@dataclass(frozen=True)
class _Camera:
    """The results of the steps of one camera."""

    id: int
    array: Path
    manifest: Output
    stripe: Output
    points: Output
    colours: Output | None


def _camera_steps(
    scan: RecordedScan,
    camera: CameraFilm,
    calibration: ScanCalibration,
    parameters: ScanParameters,
    digests: FileDigests,
    add: Callable[[Step], Output],
) -> _Camera:
    """The steps from one camera's film to its world points, and to their colours if it has laser-off frames."""
    film = scan.film(camera)
    array = scan.array(camera)
    manifest = add(
        Step(
            scan.name, "ingest", f"{STEPS}.ingest", None, {"film": source_files(film, digests)}, camera.id,
            places={"film": film, "array": array}, writes=array / "zarr.json",
        )
    )  # fmt: skip
    manifests: dict[str, Input] = {"manifest": manifest}
    places = {"array": array}
    if (background := scan.background(camera)) is not None:
        places["background"] = laser_off = scan.background_array(camera)
        manifests["background"] = add(
            Step(
                scan.name, "background", f"{STEPS}.ingest_background", None,
                {"manifest": manifest, "background": source_files(background, digests)}, camera.id,
                places={"background": background, "array": laser_off}, writes=laser_off / "zarr.json",
            )
        )  # fmt: skip
    extraction = parameters.extraction.with_laser(scan.document.laser)
    stripe = add(Step(scan.name, "extract", f"{STEPS}.extract", extraction, manifests, camera.id, places=places))
    inputs: dict[str, Input] = {
        "stripe": stripe, "manifest": manifest, "calibration": calibration.camera(camera.id), **_travel(scan, camera)
    }  # fmt: skip
    points = add(
        Step(scan.name, "map", f"{STEPS}.map_points", parameters.mapping, inputs, camera.id, places={"film": film})
    )
    colours = None
    if background is not None:
        colour_inputs: dict[str, Input] = {"stripe": stripe, "background": manifests["background"]}
        arrays = {"background": places["background"]}
        colours = add(Step(scan.name, "colour", f"{STEPS}.colour", None, colour_inputs, camera.id, places=arrays))
    return _Camera(camera.id, array, manifest, stripe, points, colours)


def source_files(path: Path, digests: FileDigests) -> SourceFile:
    """Make the input of a step from a film or another file of the archive; RefusedInput if it cannot be read."""
    files = film_files(path)
    states = {file: digests.of(file) for file in files}
    if files == [path]:
        digest = states[path][0]
    else:
        digest = sha256(canonical_json([[file.name, state[0]] for file, state in states.items()]).encode())
    return SourceFile(path, digest, tuple((file, state[1]) for file, state in states.items()))


def _travel(scan: RecordedScan, camera: CameraFilm) -> dict[str, Value]:
    positions = scan.positions(camera)
    if positions is not None:
        x_mm = [None if math.isnan(x) else x for x in read_positions(positions).tolist()]
        return {"positions": Value(canonical_json({"file": positions.name, "x_mm": x_mm}).encode(), positions)}
    travel = camera.travel or scan.document.travel
    assert travel is not None, "the format of scan.yaml requires it"
    return {"travel": _document(travel, scan.file)}


# The text of parameters is made once an object, so that scans share them.
@lru_cache(maxsize=64)
def _foot_parameters(side: Side) -> FootParameters:
    return FootParameters(side=side)


@lru_cache(maxsize=64)
def _measure_parameters(side: Side, posture: Posture, axis: Axis) -> MeasureParameters:
    return MeasureParameters(side=side, posture=posture, axis=axis)


@lru_cache(maxsize=64)
def _sizes_parameters(people: People | None, systems: tuple[str, ...]) -> SizesParameters:
    return SizesParameters(people=people, systems=list(systems))


def _landmarks(decided: Decisions) -> Value | None:
    """Landmarks that a person has set; who set them, and when, changes no measure."""
    points = decided.landmarks.points()
    return Value(canonical_json(points).encode(), decided.landmarks_file) if points else None


def _document(document: Document, path: Path) -> Value:
    return Value(_text(document).encode(), path)


def _text(document: Document) -> str:
    return canonical_json(document.model_dump(mode="json"))


def _name(scan: RecordedScan) -> Value:
    return Value(canonical_json({"patient": scan.document.patient, "scan": scan.document.scan}).encode())


def _about(scan: RecordedScan, parameters: ScanParameters) -> Value:
    about = {
        "patient": scan.document.patient,
        "scan": scan.document.scan,
        "provenance": _provenance(parameters_text(parameters)),
    }
    return Value(canonical_json(about).encode())


@lru_cache(maxsize=8)
def _provenance(parameters: str) -> dict[str, str]:
    return {
        f"{step}.{name}": canonical_json(value)
        for step, values in json.loads(parameters)["values"].items()
        for name, value in values.items()
    }
