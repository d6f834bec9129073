"""Tables of heads and cameras: where the heads were, how far cameras disagree on the same skin, and what was moved."""

import math

from footscan.report.markup import number, number_or_dash, table, text, words
from schemas.calibration import view_name
from schemas.fusion import CameraCorrection, FusionReport
from schemas.heads import HeadsReport


def heads_table(report: HeadsReport) -> str:
    """A row for each head: where it was along the travel, beside where the calibration says."""
    if not report.heads:
        return '<p class="note">Cameras of different heads see too little of the same skin to compare the heads.</p>'
    headings = ["Head", "Cameras", "Along the travel, mm", "Yaw, degrees", "Pitch, degrees", "Travel, %"]
    rows = [
        [
            str(head.head),
            ", ".join(map(str, head.cameras)),
            f"{number(head.offset_mm, 2)} ± {number(head.sd[0], 2)}",
            *(number(math.degrees(turn), 2) for turn in (head.yaw, head.pitch)),
            number(100 * head.scale, 2),
        ]
        for head in report.heads
    ]
    return table(headings, rows, numeric=range(2, len(headings)), kind="dense")


def disagreement_table(report: FusionReport) -> str:
    """A row for each pair of cameras that see the same skin, before and after the corrections."""
    if not report.pairs:
        return '<p class="note">No two cameras see the same skin.</p>'
    headings = ["Cameras", "Places", *(f"{name} {when}, mm" for name in _FIGURES for when in ("before", "after"))]
    rows = [
        [
            " and ".join(map(view_name, pair.cameras)),
            number(pair.points),
            *(number(getattr(when, name), 3) for name in _FIGURES.values() for when in (pair.before, pair.after)),
        ]
        for pair in report.pairs
    ]
    return table(headings, rows, numeric=range(1, len(headings)), kind="dense")


def corrections_table(report: FusionReport) -> str:
    """A row for each camera: its correction, the held-out error, and how many of its points gave way to others."""
    if not report.corrections:
        return ""
    headings = ["Camera", "Correction", "Moves at most, mm", "Held out before, mm", "Held out after, mm", "Gave way"]
    rows = [_row(correction, report.contradicted.get(correction.camera, 0)) for correction in report.corrections]
    return table(headings, rows, numeric=range(2, len(headings)), kind="dense")


def _row(correction: CameraCorrection, contradicted: int) -> list[str]:
    held_out = (correction.held_out_before_mm, correction.held_out_after_mm)
    return [
        view_name(correction.camera),
        text(words(correction.kind)),
        number(correction.largest_mm, 3),
        *(number_or_dash(value, 3) for value in held_out),
        number(contradicted),
    ]


_FIGURES = {"RMS": "rms_mm", "Median": "median_mm", "Deviation": "deviation_mm"}
