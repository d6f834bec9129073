"""A scan as the list of its steps."""

import math
from dataclasses import dataclass
from pathlib import Path

from footscan.frames.film import film_files
from footscan.frames.travel import read_positions
from pipelines.engine.digest import FileDigests, sha256
from pipelines.engine.step import Input, Output, SourceFile, Step, Value
from pipelines.recorded import RecordedScan
from pipelines.steps import (
    clean,
    cloud_ply,
    extract,
    foot_stl,
    fuse,
    ingest,
    ingest_background,
    map_points,
    measure,
    orient,
    quality,
    report,
    surface,
    verify,
)
from schemas.calibration import Calibration, Source
from schemas.documents import Document, canonical_json
from schemas.parameters.foot import FootParameters
from schemas.scan import CameraFilm
from schemas.workflow import ScanParameters

DELIVERED = {
    "cloud.ply": "cloud.ply",
    "foot.stl": "foot.stl",
    "measures.json": "measure",
    "quality.json": "quality",
    "report.html": "report",
}
"""What lies in a scan's results, and the step that makes it."""


@dataclass(frozen=True)
class CalibrationFile:
    """A calibration, where it was read from and its file's digest."""

    path: Path
    content: Calibration
    digest: str


def scan_steps(
    scan: RecordedScan, calibration: CalibrationFile, parameters: ScanParameters, digests: FileDigests
) -> list[Step]:
    """The steps from a scan's films to its results, each after those whose results it takes.

    Raises
    ------
    RefusedInput
        A film, a background, a file of positions or the truth is missing, or the calibration lacks a camera.
    """
    steps: list[Step] = []

    def add(step: Step) -> Output:
        steps.append(step)
        return Output(step.name)

    manifests: dict[str, Output] = {}
    stripes: dict[str, Output] = {}
    points: dict[str, Output] = {}
    arrays: dict[str, Path] = {}
    for camera in scan.document.cameras:
        film = scan.film(camera)
        array = scan.array(camera)
        manifest = add(
            Step(
                scan.name, "ingest", ingest, None, {"film": source_files(film, digests)}, camera.id,
                places={"film": film, "array": array}, writes=array / "zarr.json",
            )
        )  # fmt: skip
        filmed: dict[str, Input] = {"manifest": manifest}
        places = {"array": array}
        if (background := scan.background(camera)) is not None:
            places["background"] = laser_off = scan.background_array(camera)
            filmed["background"] = add(
                Step(
                    scan.name, "background", ingest_background, None,
                    {"manifest": manifest, "background": source_files(background, digests)}, camera.id,
                    places={"background": background, "array": laser_off}, writes=laser_off / "zarr.json",
                )
            )  # fmt: skip
        stripe = add(Step(scan.name, "extract", extract, parameters.extraction, filmed, camera.id, places=places))
        model = _document(calibration.content.camera(camera.id, calibration.path))
        inputs: dict[str, Input] = {
            "stripe": stripe,
            "manifest": manifest,
            "calibration": model,
            **_travel(scan, camera),
        }
        points[f"points-{camera.id}"] = add(Step(scan.name, "map", map_points, parameters.mapping, inputs, camera.id))
        manifests[f"manifest-{camera.id}"] = manifest
        stripes[f"stripe-{camera.id}"] = stripe
        arrays[f"array-{camera.id}"] = array

    foot = FootParameters(side=scan.document.side)
    fused = add(Step(scan.name, "fuse", fuse, parameters.fusion, points))
    cleaned = add(Step(scan.name, "clean", clean, parameters.outliers, {"cloud": fused}))
    oriented = add(Step(scan.name, "orient", orient, parameters.normals, {"clean": cleaned}))
    mesh = add(Step(scan.name, "surface", surface, parameters.surface, {"oriented": oriented}))
    measures = add(Step(scan.name, "measure", measure, foot, {"surface": mesh}))
    verified: dict[str, Output] = {}
    if (truth := scan.truth) is not None:
        pair: dict[str, Input] = {"surface": mesh, "truth": source_files(truth, digests)}
        verified = {"verified": add(Step(scan.name, "verify", verify, None, pair, places={"truth": truth}))}
    of_cameras = {**manifests, **stripes, **verified}
    judged: dict[str, Input] = {"clean": cleaned, "surface": mesh, "calibration": _source(calibration), **of_cameras}
    qualities = add(Step(scan.name, "quality", quality, None, judged))
    add(Step(scan.name, "cloud.ply", cloud_ply, None, {"oriented": oriented}))
    add(Step(scan.name, "foot.stl", foot_stl, foot, {"surface": mesh}))
    shown: dict[str, Input] = {
        "oriented": oriented, "surface": mesh, "measures": measures, "quality": qualities,
        "calibration": _used(calibration, scan), "about": _about(scan, parameters), **of_cameras,
    }  # fmt: skip
    add(Step(scan.name, "report", report, foot, shown, places=arrays))
    return steps


def source_files(path: Path, digests: FileDigests) -> SourceFile:
    """A film, or another file of the archive, as input of a step."""
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
        return {"positions": Value(canonical_json({"file": positions.name, "x_mm": x_mm}).encode())}
    travel = camera.travel or scan.document.travel
    assert travel is not None, "scan.yaml was checked for it"
    return {"travel": _document(travel)}


def _document(document: Document) -> Value:
    return Value(canonical_json(document.model_dump(mode="json")).encode())


def _source(calibration: CalibrationFile) -> Value:
    return _document(Source(name=calibration.path.name, sha256=calibration.digest))


def _used(calibration: CalibrationFile, scan: RecordedScan) -> Value:
    """The calibration, with the maps of the scan's cameras alone."""
    ids = {camera.id for camera in scan.document.cameras}
    cameras = [camera for camera in calibration.content.cameras if camera.camera in ids]
    return _document(calibration.content.model_copy(update={"cameras": cameras}))


def _about(scan: RecordedScan, parameters: ScanParameters) -> Value:
    provenance = {
        f"{step}.{name}": canonical_json(value)
        for step, values in parameters.model_dump(mode="json").items()
        for name, value in values.items()
    }
    about = {"patient": scan.document.patient, "scan": scan.document.scan, "provenance": provenance}
    return Value(canonical_json(about).encode())
