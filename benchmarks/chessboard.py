"""Mapping error of the two ways to calibrate: from the reference object, and from pictures of a chessboard.

    .venv/bin/python -m benchmarks.chessboard [BOARDS CAPTURE]

BOARDS and CAPTURE are folders that `footscan simulate chessboard` and `footscan simulate capture` wrote with their
standard settings; without them they are made. What judges is the scanner's own projection, which no calibration has
seen: points of a grid in the laser plane are projected by the true camera and mapped back. Both calibrations of a
camera are judged by the same points, those in the regions of both.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from footscan.calibration.models.maps import is_supported, to_world
from footscan.virtual.chessboard.record import record_chessboard
from footscan.virtual.filming.capture import record_capture
from footscan.virtual.optics.scanner import VOLUME_MM, standard_scanner
from footscan.virtual.stage.reference import standard_reference
from pipelines.capture_job import calibrate_capture
from pipelines.chessboard_job import calibrate_chessboard
from pipelines.recordings.captures import read_capture
from pipelines.recordings.chessboards import read_chessboard
from schemas.parameters.calibration import CaptureCalibrationParameters
from schemas.parameters.simulation import SimulationSettings

GRID_MM = 2.0


def main() -> None:
    if sys.argv[1:]:
        boards, capture = map(Path, sys.argv[1:3])
        _compare(boards, capture)
        return
    with tempfile.TemporaryDirectory() as place:
        boards, capture = Path(place) / "boards", Path(place) / "capture"
        record_chessboard(boards, settings=SimulationSettings())
        record_capture(capture, standard_reference(), settings=SimulationSettings())
        _compare(boards, capture)


def _compare(boards: Path, capture: Path) -> None:
    by_object = calibrate_capture(read_capture(capture), CaptureCalibrationParameters(), 2, None).calibration
    by_board = calibrate_chessboard(read_chessboard(boards)).calibration
    y, z = (axis.ravel() for axis in np.meshgrid(*(np.arange(low, high + 1.0, GRID_MM) for low, high in VOLUME_MM)))
    places = np.column_stack([y, z])
    print("| camera | points | object: rms | worst | chessboard: rms | worst |")
    print("|---:|---:|---:|---:|---:|---:|")
    for camera in standard_scanner(SimulationSettings().scanner_seed).cameras:
        pixels = camera.project_plane(y, z)
        maps = [calibration.camera(camera.id) for calibration in (by_object, by_board)]
        judged = np.logical_and(*(is_supported(own, pixels) for own in maps))
        cells = []
        for own in maps:
            errors = np.linalg.norm(to_world(own, pixels[judged]) - places[judged], axis=1)
            cells += [f"{np.sqrt(np.mean(errors**2)):.3f}", f"{errors.max():.3f}"]
        print(f"| {camera.id} | {np.count_nonzero(judged)} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
