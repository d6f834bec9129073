"""`footscan calibrate travel` and `footscan calibrate body`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.calibrate.file import tell_calibration, write_calibration
from pipelines.cli.terminal.output import AsJson, keep_inputs, message, print_json, print_table

if TYPE_CHECKING:
    from schemas.calibration import Calibration


def travel(
    folder: Annotated[Path, typer.Argument(help="Folder with scan.yaml and the films of the body.")],
    calibration: Annotated[
        Path | None, typer.Option(help="Calibration with the cameras' maps; default: the one that scan.yaml names.")
    ] = None,
    body: Annotated[
        Path | None, typer.Option(help="Mesh of the body in mm (STL, PLY, OBJ); default: the standard one.")
    ] = None,
    rig: Annotated[
        Path | None,
        typer.Option(help="rig.yaml: the head of each camera; default: two above on each side, four below."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Calibration file to write.")] = None,
    cache: Annotated[
        Path | None, typer.Option(help="Folder of a result store; results of this film that it holds are reused.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find where the laser planes lie along the travel, from a film of a body."""
    from footscan.calibration.travel.body import standard_body
    from footscan.recordings.scans import read_scan
    from pipelines.engine.files.digest import sha256
    from pipelines.engine.pool import cores
    from pipelines.live.rig_file import read_rig
    from pipelines.scan import CalibrationFile
    from pipelines.travel_job import calibrate_travel, read_body
    from schemas.base.errors import RefusedInput
    from schemas.calibration import read_calibration, with_offsets
    from schemas.rig import USUAL_HEADS

    film = read_scan(folder)
    maps = calibration or film.calibration
    if maps is None:
        raise RefusedInput(film.file, "names no calibration, expected one here or --calibration", field="calibration")
    keep_inputs([out], maps, film.file, *([] if body is None else [body]))
    shape = standard_body() if body is None else read_body(body)
    heads = dict(USUAL_HEADS)
    content = read_calibration(maps)
    if rig is not None:
        described = read_rig(rig)
        heads = {camera.id: camera.on_head for camera in described.cameras}
        content = with_offsets(content, {camera.id: described.lasers_of(camera) for camera in described.cameras})
    for camera in film.document.cameras:
        if camera.id not in heads:
            raise RefusedInput(rig or "--rig", f"says no head of camera {camera.id}, expected one", field="cameras")
    known = CalibrationFile(maps, content, sha256(maps.read_bytes()))
    made = calibrate_travel(film, known, heads, shape, cores(), cache)
    write_calibration(made, out)
    if as_json:
        print_json(
            {
                "planes": {camera.name: camera.plane and camera.plane.model_dump() for camera in made.cameras},
                "body_rms_mm": made.body_rms_mm,
                "warnings": made.warnings,
            }
        )
    else:
        print_planes(made)
    for warning in made.warnings:
        message(f"{folder}: {warning}")
    tell_calibration(made, out)


def print_planes(calibration: "Calibration") -> None:
    """Print where the laser plane of each camera lies."""
    from footscan.report.calibration.planes import CAMERA_COLUMNS, HEAD_COLUMNS, plane_cells

    rows = [
        [camera.name, str(camera.plane.head), *plane_cells(camera.plane)]
        for camera in calibration.cameras
        if camera.plane is not None
    ]
    print_table("Laser planes", ["camera", "head", *HEAD_COLUMNS, *CAMERA_COLUMNS], rows)


def body(
    out: Annotated[Path, typer.Argument(help="Mesh to write: STL, PLY or OBJ.")],
) -> None:
    """Write the body that shows the laser planes, for a machinist."""
    import numpy as np

    from footscan.calibration.travel.body import CUT_MM, SIZE_MM, TOLERANCE_MM, TURN_DEG, standard_body
    from footscan.mesh.formats.files import mesh_bytes
    from footscan.mesh.mesh import Mesh
    from pipelines.engine.files.atomic import write_atomically

    shape = standard_body()
    write_atomically(out, mesh_bytes(Mesh(shape.vertices, shape.faces.astype(np.int32)), out.suffix))
    message(
        f"{out}: {SIZE_MM[0]:g} x {SIZE_MM[1]:g} x {SIZE_MM[2]:g} mm, all edges cut {CUT_MM:g} mm at 45 degrees, each "
        f"face to {TOLERANCE_MM:g} mm; matt and light; stands at {TURN_DEG:g} degrees to the travel"
    )
