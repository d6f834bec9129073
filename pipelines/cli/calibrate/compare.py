"""`footscan calibrate compare`."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.terminal.output import AsJson, figure, message, print_json, print_line, print_table
from schemas.base.errors import one_line

if TYPE_CHECKING:
    from footscan.calibration.checks.comparison import CameraComparison

COLUMNS = ("camera", "model", "shared %", "mean Y mm", "mean Z mm", "rms mm", "largest mm", "at i, j", "left mm")
MEANING = (
    "Shared: of the pixels in either region, those in both; over them B minus A. "
    "Left: rms after the shift and the turn that bring B nearest to A."
)


def compare(
    a: Annotated[Path, typer.Argument(help="Calibration file.", metavar="A")],
    b: Annotated[Path, typer.Argument(help="Another calibration of the same scanner.", metavar="B")],
    tolerance_mm: Annotated[
        float | None,
        typer.Option(
            min=0, help="RMS difference in mm above which the exit status is 1; also if a camera cannot be compared."
        ),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Compare two calibrations, camera by camera, in millimetres."""
    from footscan.calibration.checks.comparison import compare_calibrations, worst_beyond
    from schemas.calibration import read_calibration

    comparisons = compare_calibrations(read_calibration(a), read_calibration(b))
    if as_json:
        print_json([asdict(comparison) for comparison in comparisons])
    else:
        _print(comparisons, f"B, {one_line(str(b))}, minus A, {one_line(str(a))}")
    if tolerance_mm is None:
        return 0
    worst = worst_beyond(comparisons, tolerance_mm)
    if worst is None:
        return 0
    if worst.rms_mm is None:
        message(f"camera {worst.camera} cannot be compared: {'; '.join(worst.remarks)}")
    else:
        message(f"camera {worst.camera} differs most: {worst.rms_mm:.4g} mm rms, more than {tolerance_mm:g} mm")
    return 1


def _print(comparisons: "list[CameraComparison]", title: str) -> None:
    in_both = [found for found in comparisons if found.model_a is not None and found.model_b is not None]
    if in_both:
        print_table(title, COLUMNS, [_row(found) for found in in_both])
        print_line(MEANING)
    for remark in dict.fromkeys(remark for found in comparisons for remark in found.remarks):
        cameras = [str(found.camera) for found in comparisons if remark in found.remarks]
        print_line(f"Camera{'s' if len(cameras) > 1 else ''} {', '.join(cameras)}: {remark}.")


def _row(found: "CameraComparison") -> list[str]:
    same_model = found.model_a == found.model_b
    at = found.largest_at_px
    return [
        str(found.camera),
        str(found.model_a) if same_model else f"A: {found.model_a}; B: {found.model_b}",
        "-" if found.shared_fraction is None else f"{100 * found.shared_fraction:.1f}",
        figure(found.mean_y_mm, "+.3f"),
        figure(found.mean_z_mm, "+.3f"),
        figure(found.rms_mm),
        figure(found.largest_mm),
        "-" if at is None else f"{at[0]:.0f}, {at[1]:.0f}",
        figure(found.left_rms_mm),
    ]
