"""Mapping error of calibrations on control points that they have not seen, in mm.

    .venv/bin/python -m benchmarks.calibration [CHART]

The thesis's calibration knows five corners of the reference object. For the others, the control points of each camera
are dealt into five parts by their place in the world, and each part in turn is held out. All are judged by the same
points, the five left out.
"""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chart import Chart, read_chart
from footscan.calibration.from_chart import calibrate_chart
from footscan.calibration.maps import to_world
from schemas.calibration import CameraCalibration, Source
from schemas.parameters.calibration import CalibrationParameters
from schemas.units import MILLIMETRES

DEFAULT = Path("demo/capture/chart.csv")
PARTS = 5
THESIS_CORNERS_MM = {
    (1, 2): [(50, 30), (50, 70), (20, 70), (20, 100), (-20, 100)],
    (3, 4): [(-50, 30), (-50, 70), (-20, 70), (-20, 100), (20, 100)],
    (5, 6): [(-20, 0), (20, 0), (20, 30), (50, 30), (50, 70)],
    (7, 8): [(20, 0), (-20, 0), (-20, 30), (-50, 30), (-50, 70)],
}
"""Y and Z of the corners that the thesis used for each camera."""


def main() -> None:
    charts = read_chart(Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT)
    errors = {
        "quadratic, five points": {camera: _five_points(chart) for camera, chart in charts.items()},
        "quadratic, all points": {camera: _held_out(chart, "quadratic") for camera, chart in charts.items()},
        "polynomial of chosen order": {camera: _held_out(chart, "polynomial") for camera, chart in charts.items()},
        "chosen model": {camera: _held_out(chart, "auto") for camera, chart in charts.items()},
    }
    baseline = next(iter(errors.values()))
    print(f"  {'rms mm of held-out points':<28}" + "".join(f"{f'camera {camera}':>10}" for camera in charts))
    for name, by_camera in errors.items():
        print(f"  {name:<28}" + "".join(f"{_rms(error):10.3f}" for error in by_camera.values()))
    print(
        f"\n  {'all cameras':<28}{'rms mm':>10}{'median mm':>12}{'largest mm':>12}   rms to the baseline's, by camera"
    )
    for name, by_camera in errors.items():
        every = np.concatenate(list(by_camera.values()))
        ratios = np.array([_rms(error) / _rms(baseline[camera]) for camera, error in by_camera.items()])
        spread = f"{np.median(ratios):.4f} ({ratios.min():.4f} to {ratios.max():.4f})"
        ratio = "baseline" if by_camera is baseline else spread
        print(f"  {name:<28}{_rms(every):10.3f}{np.median(every):12.3f}{every.max():12.3f}   {ratio}")


def _five_points(chart: Chart) -> NDArray[np.float64]:
    """(N,) mm: how far the points besides the thesis's are mapped from their places by its calibration."""
    known = _thesis_points(chart)
    return _errors(_fit(_subset(chart, known), "quadratic"), _subset(chart, ~known))


def _held_out(chart: Chart, model: str) -> NDArray[np.float64]:
    """(N,) mm: the same points, each mapped by a calibration that was made without its part."""
    place = np.unique(chart.world, axis=0, return_inverse=True)[1].ravel()
    part = np.random.default_rng(1).permutation(place.max() + 1)[place] % PARTS
    judged = ~_thesis_points(chart)
    return np.concatenate(
        [
            _errors(_fit(_subset(chart, part != out), model), _subset(chart, judged & (part == out)))
            for out in range(PARTS)
        ]
    )


def _thesis_points(chart: Chart) -> NDArray[np.bool_]:
    """Which of (N,) points are the thesis's five, or the nearest to them."""
    corners = next(corners for cameras, corners in THESIS_CORNERS_MM.items() if chart.camera in cameras)
    distance = np.linalg.norm(MILLIMETRES[chart.unit] * chart.world[:, None, 1:] - np.array(corners), axis=2)
    return np.isin(np.arange(len(distance)), distance.argmin(axis=0))


def _errors(camera: CameraCalibration, chart: Chart) -> NDArray[np.float64]:
    residuals = to_world(camera, chart.pixels) - MILLIMETRES[chart.unit] * chart.world[:, 1:]
    return np.asarray(np.hypot(residuals[:, 0], residuals[:, 1]))


def _fit(chart: Chart, model: str) -> CameraCalibration:
    parameters = CalibrationParameters.model_validate({"model": model})
    calibration, _ = calibrate_chart(
        {chart.camera: chart}, parameters=parameters, source=Source(name="chart", sha256=""), software=""
    )
    return calibration.cameras[0]


def _subset(chart: Chart, rows: NDArray[np.bool_]) -> Chart:
    names = tuple(name for name, taken in zip(chart.points, rows, strict=True) if taken)
    return Chart(chart.camera, names, chart.world[rows], chart.unit, chart.pixels[rows])


def _rms(distance: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(distance**2)))


if __name__ == "__main__":
    main()
