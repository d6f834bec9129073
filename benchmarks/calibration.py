"""Mapping error of calibrations of the same capture, in mm, from five clicked points to all of the stripe.

    .venv/bin/python -m benchmarks.calibration [CAPTURE ...]

CAPTURE is a folder that the virtual scanner filmed with its standard settings; without one, the reference object is
filmed in its first five placements, and in the first alone. What judges is the scanner's own projection, which no
calibration has seen: points of a grid in the laser plane are projected by the true camera and mapped back. All
calibrations of a camera are judged by the same points, those in the region that the stripe supports.

Last, the processor time of calibrating with nothing cached is held beside that of decoding the frames and extracting
the stripe.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from benchmarks.compare import interleave, print_ratios
from footscan.calibration.chart.chart import Chart, read_chart
from footscan.calibration.chart.from_chart import calibrate_chart
from footscan.calibration.models.maps import is_supported, to_world
from footscan.virtual.filming.capture import record_capture
from footscan.virtual.optics.scanner import VOLUME_MM, Camera, standard_scanner
from footscan.virtual.stage.reference import standard_reference
from pipelines.capture_job import CaptureCalibration, calibrate_capture
from pipelines.recordings.captures import read_capture
from pipelines.steps import capture_stripe
from schemas.calibration import Calibration, CameraCalibration, Source
from schemas.parameters.calibration import CalibrationParameters, CaptureCalibrationParameters
from schemas.parameters.simulation import SimulationSettings

Floats = NDArray[np.float64]

PLACEMENTS = (5, 1)
ROUNDS = 3
GRID_MM = 2.0
BASELINE = "five clicks, quadratic"
THESIS_CORNERS_MM = {
    (1, 2): [(50, 30), (50, 70), (20, 70), (20, 100), (-20, 100)],
    (3, 4): [(-50, 30), (-50, 70), (-20, 70), (-20, 100), (20, 100)],
    (5, 6): [(-20, 0), (20, 0), (20, 30), (50, 30), (50, 70)],
    (7, 8): [(20, 0), (-20, 0), (-20, 30), (-50, 30), (-50, 70)],
}
"""Y and Z of the corners that the thesis used for each camera, with the object in the middle."""

Errors = dict[str, dict[int, Floats]]
"""By calibration and camera: (N,) mm, how far points of the grid are mapped from their places."""


def main() -> None:
    for folder in sys.argv[1:]:
        _compare(Path(folder))
    if not sys.argv[1:]:
        with tempfile.TemporaryDirectory() as place:
            for placements in PLACEMENTS:
                _compare(_film(Path(place) / str(placements), placements))


def _film(folder: Path, placements: int) -> Path:
    reference = standard_reference()
    shown = reference.model_copy(update={"placements_mm": reference.placements_mm[:placements]})
    record_capture(folder, shown, settings=SimulationSettings())
    return folder


def _compare(folder: Path) -> None:
    charts = read_chart(folder / "chart.csv")
    stripe = _from_stripe(folder, "auto")
    calibrations = {
        BASELINE: _from_clicks({camera: _thesis_clicks(chart) for camera, chart in charts.items()}, "quadratic"),
        "all clicks, chosen model": _from_clicks(charts, "auto"),
        "stripe, quadratic": _from_stripe(folder, "polynomial", order=2).calibration,
        "stripe, chosen model": stripe.calibration,
    }
    errors: Errors = {name: {} for name in calibrations}
    for camera in standard_scanner(SimulationSettings().scanner_seed).cameras:
        plane, pixels = _seen_grid(camera, stripe.calibration.camera(camera.id))
        for name, calibration in calibrations.items():
            mapped = to_world(calibration.camera(camera.id), pixels)
            errors[name][camera.id] = np.linalg.norm(mapped - plane, axis=1)
    clicks = ", ".join(str(len(chart.points)) for chart in charts.values())
    print(f"\nPlacements: {len(stripe.departures_mm)}. Clicks of each camera: {clicks}")
    _print_cameras(errors, {trial.camera: trial.model for trial in stripe.trials if trial.status == "chosen"})
    _print_all(errors)
    runs = {
        "decoding and extraction (baseline)": lambda: _extract(folder),
        "calibrating": lambda: _from_stripe(folder, "auto"),
    }
    print_ratios("Processor time", interleave(runs, ROUNDS, time.process_time), 1, "capture")


def _extract(folder: Path) -> None:
    """Find the stripe in all frames of a capture."""
    capture = read_capture(folder)
    for camera in capture.document.cameras:
        places = {"film": capture.film(camera), "capture": capture.file}
        capture_stripe.run({"film": b""}, CaptureCalibrationParameters().extraction, places)


def _from_clicks(charts: dict[int, Chart], model: str) -> Calibration:
    parameters = CalibrationParameters.model_validate({"model": model})
    return calibrate_chart(charts, parameters=parameters, source=Source(name="chart", sha256=""), software="")[0]


def _from_stripe(folder: Path, model: str, order: int | None = None) -> CaptureCalibration:
    parameters = CaptureCalibrationParameters.model_validate({"model": model, "order": order})
    return calibrate_capture(read_capture(folder), parameters, workers=2)


def _thesis_clicks(chart: Chart) -> Chart:
    """Five clicks, on the thesis's corners, or where one could not be clicked on the nearest place that could.

    A place that was clicked in several placements counts with the first, the object in the middle.
    """
    corners = next(corners for cameras, corners in THESIS_CORNERS_MM.items() if chart.camera in cameras)
    places, first = np.unique(chart.world[:, 1:], axis=0, return_index=True)
    distance = np.linalg.norm(np.array(corners, np.float64)[:, np.newaxis] - places, axis=2)
    rows = first[linear_sum_assignment(distance)[1]]
    names = tuple(chart.points[row] for row in rows)
    return Chart(chart.camera, names, chart.world[rows], chart.unit, chart.pixels[rows])


def _seen_grid(camera: Camera, stripe: CameraCalibration) -> tuple[Floats, Floats]:
    """The grid's points in the region that the stripe supports: (Y, Z) in mm and their exact pixels, (N, 2) each."""
    y, z = (np.arange(low, high + GRID_MM, GRID_MM) for low, high in VOLUME_MM)
    plane = np.stack(np.meshgrid(y, z), axis=-1).reshape(-1, 2)
    pixels = camera.project_plane(plane[:, 0], plane[:, 1])
    inside = is_supported(stripe, pixels)
    return plane[inside], pixels[inside]


def _print_cameras(errors: Errors, chosen: dict[int, str]) -> None:
    print(f"  {'rms (largest) mm':<18}" + "".join(f"{name:>26}" for name in errors) + "   on a grid of   chosen model")
    for camera, model in chosen.items():
        cells = [f"{_rms(found[camera]):.3f} ({found[camera].max():.3f})" for found in errors.values()]
        points = len(errors[BASELINE][camera])
        print(f"  {f'camera {camera}':<18}" + "".join(f"{cell:>26}" for cell in cells) + f"{points:>15}   {model}")


def _print_all(errors: Errors) -> None:
    title = "rms to the baseline's, by camera"
    print(f"\n  {'all cameras':<26}{'rms mm':>10}{'median mm':>12}{'largest mm':>12}   {title}")
    for name, found in errors.items():
        every = np.concatenate(list(found.values()))
        ratios = np.array([_rms(found[camera]) / _rms(errors[BASELINE][camera]) for camera in found])
        spread = f"{np.median(ratios):.5f} ({ratios.min():.5f} to {ratios.max():.5f})"
        ratio = "baseline" if name == BASELINE else spread
        print(f"  {name:<26}{_rms(every):10.3f}{np.median(every):12.3f}{every.max():12.3f}   {ratio}")


def _rms(distance: Floats) -> float:
    return float(np.sqrt(np.mean(distance**2)))


if __name__ == "__main__":
    main()
