"""`footscan calibrate chessboard`."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.calibrate.file import tell_calibration, write_calibration
from pipelines.cli.terminal.output import AsJson, keep_inputs, message, print_json, print_line, print_table

if TYPE_CHECKING:
    from pipelines.chessboard_job import ChessboardCalibration

COLUMNS = ("camera", "boards", "stripes", "focal px", "corners px", "own mm", "held-out mm", "worst mm", "map mm")
MEANING = (
    "Corners: distance from where the camera would see them, root mean square. Own: distance of the stripe's places by "
    "the map from those on the board, root mean square. Held-out: the same for pictures that were left out. Worst: the "
    "largest of these. Map: the largest distance between the map and the pinhole."
)


def chessboard(
    folder: Annotated[Path, typer.Argument(help="Folder with chessboard.yaml and the pictures.")],
    out: Annotated[Path | None, typer.Option(help="Calibration file to write.")] = None,
    as_json: AsJson = False,
) -> None:
    """Calibrate from pictures of a chessboard, with and without the stripe (Zhang 2000)."""
    from pipelines.chessboard_job import calibrate_chessboard
    from pipelines.cli.calibrate.travel import print_planes
    from pipelines.cli.terminal.progress import frame_progress
    from pipelines.recordings.chessboards import read_chessboard

    recorded = read_chessboard(folder)
    keep_inputs([out], *recorded.files)
    with frame_progress("cameras") as progress:
        made = calibrate_chessboard(recorded, progress)
    write_calibration(made.calibration, out)
    if as_json:
        print_json(_json(made))
    else:
        print_table("Cameras from pictures of a chessboard", COLUMNS, _rows(made))
        print_line(MEANING)
        if made.calibration.cameras[0].plane is not None:
            print_planes(made.calibration)
    for warning in made.calibration.warnings:
        message(f"{folder}: {warning}")
    if made.planes and made.calibration.cameras[0].plane is None:
        message("all laser planes stand across the travel, as far as the placed boards can tell: none is written")
    tell_calibration(made.calibration, out)


def _rows(made: "ChessboardCalibration") -> list[list[str]]:
    rows = []
    for one in made.cameras:
        camera = one.camera
        held_out = "-" if camera.held_out_rms_mm is None else f"{camera.held_out_rms_mm:.3f}"
        focal, stripes = one.fit.sight.pinhole.focal_px[0], len(one.fit.stripe_mm)
        errors = [f"{camera.rms_mm:.3f}", held_out, f"{camera.worst_mm:.3f}", f"{one.misfit_mm:.3f}"]
        rows.append(
            [str(camera.camera), str(one.views), str(stripes), f"{focal:.1f}", f"{one.corners_px:.3f}", *errors]
        )
    return rows


def _json(made: "ChessboardCalibration") -> dict[str, object]:
    return {
        "cameras": [
            camera.model_dump(mode="json")
            | {
                "boards": one.views,
                "stripes": len(one.fit.stripe_mm),
                "corners_px": one.corners_px,
                "misfit_mm": one.misfit_mm,
                "pinhole": asdict(one.fit.sight.pinhole),
            }
            for camera, one in zip(made.calibration.cameras, made.cameras, strict=True)
        ],
        "planes": {
            str(head): {"offset_mm": plane.values[0], "yaw": plane.values[1], "pitch": plane.values[2],
                        "sd": plane.deviations.tolist(), "is_off": plane.is_off}
            for head, plane in made.planes.items()
        },
        "warnings": made.calibration.warnings,
    }  # fmt: skip
