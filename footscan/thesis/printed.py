"""What the thesis prints: control points (Table 4-2), coefficients (Table 4-3), and its figures of accuracy."""

import csv
from pathlib import Path
from typing import NamedTuple

from footscan.calibration.chart.chart import Chart, read_chart

FOLDER = Path(__file__).parent
CHARTS_FILE = FOLDER / "calibration_charts.csv"
"""Five control points of each of the eight cameras, cm and px."""
COEFFICIENTS_FILE = FOLDER / "printed_coefficients.csv"
"""Coefficients of Y and Z, in the order of `TERMS`, rounded as they are printed; a camera's last ones may be left out.
"""
TERMS = ("1", "i", "j", "i^2", "ij", "j^2")
OBSERVED_Y_CM = (4.9032, 4.6643, 1.4752, 1.0706, -3.1572)
"""Y that camera 1 is printed to observe at its five control points (appendix)."""
R2_PERCENT = 92.17
"""Coefficient of determination that is printed for the Y of camera 1 (appendix)."""
BLOCK_MM, SCANNED_BLOCK_MM = (150.0, 100.0, 50.0), (151.2, 102.0, 51.4)
"""Table 6-1: a block of wood, and its scan."""
CLOTH_MM = 1.5
"""Thickness of the cloth that lay on the block when it was scanned."""
BLOCK_ACCURACY_MM = 0.5
"""Accuracy that is claimed for the scan of the block."""
FOOT_MEAN_MM, FOOT_MAX_MM = 0.35, 3.1
"""Distance of a scanned foot to that of an industrial scanner: mean and maximum (Table 6-2)."""
WITHIN_MM, WITHIN_SHARE = 1.0, 0.8
"""Share of the foot's points within this distance, as it is printed."""
CLASSES = (70, 8)
"""Numbers of classes of the histograms of these distances."""
RESOLUTION_MM = 1.78
"""Resolution that is printed for the scanner."""
PRICE_CAD, COMMERCIAL_USD = 7_500, (25_000, 75_000)
"""Price of the parts, and range of prices of commercial scanners."""


class PrintedCoefficient(NamedTuple):
    """A row of Table 4-3."""

    camera: int
    term: str
    """One of `TERMS`."""
    alpha_y: float
    """Of Y in cm."""
    alpha_z: float
    """Of Z in cm."""
    decimals: int
    """To which both are rounded."""


def printed_charts() -> dict[int, Chart]:
    """The control points of Table 4-2, by camera."""
    return read_chart(CHARTS_FILE)


def printed_coefficients() -> list[PrintedCoefficient]:
    """The rows of Table 4-3, in the order of the print.

    >>> rows = printed_coefficients()
    >>> len(rows), rows[1]
    (43, PrintedCoefficient(camera=1, term='i', alpha_y=-0.02223, alpha_z=-0.00871, decimals=5))
    """
    with COEFFICIENTS_FILE.open(newline="", encoding="utf-8") as file:
        return [
            PrintedCoefficient(
                int(row["camera"]), row["term"], float(row["alpha_y"]), float(row["alpha_z"]), int(row["decimals"])
            )
            for row in csv.DictReader(file)
        ]
