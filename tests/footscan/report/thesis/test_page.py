"""The page of the thesis: all parts are there, also where a method has no result."""

import numpy as np

from footscan.report.thesis.page import stage_rows, thesis_page
from footscan.report.thesis.reference_figure import reference_figure
from footscan.thesis.mistakes import mistakes
from footscan.verify.compare import compare
from schemas.thesis import (
    BlockDimension,
    ClickedCorners,
    FootMeasure,
    Method,
    ReconstructedFoot,
    StageOutcome,
    ThesisResult,
)

SQUARE = np.array([[0.0, 0, 0], [9, 0, 0], [9, 9, 0], [0, 9, 0]]), np.array([[0, 1, 2], [0, 2, 3]], np.int32)
METHODS: tuple[Method, ...] = ("thesis", "thesis-all-corners", "footscan")
STAGES = [
    StageOutcome(seed=1, exchanged=(), mean_mm=0.03, p99_mm=0.2, length_error_mm=-0.1, length_status="ok"),
    StageOutcome(seed=1, exchanged=("surface",), mean_mm=0.1, p99_mm=0.5),
    StageOutcome(seed=2, exchanged=(), mean_mm=0.04, p99_mm=0.3, length_error_mm=0.2, length_status="uncertain"),
    StageOutcome(seed=2, exchanged=("surface",), problem="no <foot>"),
]


def result() -> ThesisResult:
    shifted = SQUARE[0] + [0.0, 0.0, 0.25], SQUARE[1]
    ours = ReconstructedFoot(
        method="footscan",
        comparison=compare(shifted, SQUARE, classes=8, both=True),
        within_share=1.0,
        resolution_mm=0.4,
        holes_mm=[120.0, 30.0],
        measures={"foot_length": FootMeasure(value=261.8, truth=262.0, uncertainty=0.3, status="ok")},
    )
    return ThesisResult(
        coefficients=43,
        agreeing=43,
        block=[
            BlockDimension(
                nominal_mm=150.0,
                printed_mm=151.2,
                found_mm={"thesis": None, "thesis-all-corners": 150.6, "footscan": 150.02},
            )
        ],
        feet=[ReconstructedFoot(method=method, problem="no <surface>") for method in METHODS[:2]] + [ours],
        corners=[
            ClickedCorners(points=5, median_mm=13.0, worst_mm=99.0),
            ClickedCorners(points=None, median_mm=0.3, worst_mm=1.0),
        ],
        stages=STAGES,
    )


def test_the_page_has_all_parts_and_escapes_what_failed() -> None:
    page = thesis_page(result(), b"\x89PNG")

    for expected in ("Table 6-1", "Table 6-2", "Table 4-3", "Figures 4-7", "150.02", "43 of 43", "120, 30", "World 2"):
        assert expected in page
    assert "no &lt;surface&gt;" in page
    assert "<surface>" not in page
    assert all(mistake.place in page for mistake in mistakes())
    assert ThesisResult.model_validate_json(result().model_dump_json()) == result()


def test_a_row_for_each_exchange_and_a_cell_for_each_world() -> None:
    assert stage_rows(STAGES) == [
        ["footscan", "0.030, 0.20, -0.10", "0.040, 0.30, +0.20 (uncertain)"],
        ["footscan, its surface", "0.100, 0.50, not measured", "no result"],
    ]


def test_the_figure_is_the_same_for_the_same_points() -> None:
    profile = np.array([[-20.0, 0.0], [20.0, 0.0], [20.0, 100.0], [-20.0, 100.0]])
    clouds = {"one": [profile + 1.0], "other": [profile]}

    assert reference_figure(profile, clouds) == reference_figure(profile, clouds)
    assert reference_figure(profile, clouds) != reference_figure(profile, {"one": [profile], "other": [profile]})
