"""Verdicts on figures, and the file of the accepted figures."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from pipelines.regression.baseline import read_baseline, read_steps, steps_file, write_baseline
from pipelines.regression.figures.costs import cost_figures, keeps_most, unsteady
from pipelines.regression.figures.of_scan import goal_of, tolerance_of
from pipelines.regression.figures.timed import Pass, StepCost
from pipelines.regression.figures.verdict import judge_figures, verdict
from schemas.base.errors import RefusedInput
from schemas.regression import Acceptance, AcceptedStep, Suite, Tolerance

SET = {"sets": {"foot": {"virtual": {"side": "right"}}}, "format": "footscan.suite/1"}


@pytest.mark.parametrize(
    ("value", "accepted", "allowed", "goal", "truth", "expected"),
    [
        (0.3, 0.2, 0.1, "less", None, "same"),  # 0.3 - 0.2 is a little less than 0.1 in binary; so is 0.2 + 0.1 more
        (0.31, 0.2, 0.1, "less", None, "worse"),
        (0.05, 0.2, 0.1, "less", None, "better"),
        (7.0, 8.0, 0.0, "more", None, "worse"),
        (9.0, 8.0, 0.0, "more", None, "better"),
        (100.0, 101.0, 0.0, "same", None, "worse"),
        (102.0, 101.0, 0.0, "same", None, "worse"),
        (265.5, 264.8, 0.1, "nearer", 265.0, "worse"),  # 0.5 from the truth, 0.2 before
        (265.1, 264.8, 0.1, "nearer", 265.0, "better"),
        (265.2, 264.8, 0.1, "nearer", 265.0, "worse"),  # as far to the other side: something has changed
        (264.85, 264.8, 0.1, "nearer", 265.0, "same"),
        (265.0, 264.8, 0.1, "nearer", None, "worse"),  # without truth, what was accepted is right
        (None, 1.0, 0.5, "less", None, "missing"),
        (None, None, 0.0, "less", None, "same"),
        (1.0, None, 0.0, "less", None, "better"),
    ],
)
def test_verdicts(value: float, accepted: float, allowed: float, goal: str, truth: float | None, expected: str) -> None:
    assert verdict(value, accepted, allowed, goal, truth, in_baseline=True) == expected  # type: ignore[arg-type]


def test_what_the_baseline_does_not_have_is_new() -> None:
    assert verdict(1.0, None, 0.0, "less", None, in_baseline=False) == "new"
    assert verdict(None, None, 0.0, "less", None, in_baseline=False) == "new"


def test_every_kind_of_figure_has_its_goal() -> None:
    goals = {
        "accuracy.mean_mm": "less", "accuracy.within_1mm": "more", "measures.foot_length_mm": "nearer",
        "measures.missing": "less", "points.camera-3": "same", "steps.run_again": "less", "surface.holes": "less",
        "surface.coloured_share": "more", "time.cloud.ply": "less", "memory.peak_mb": "less", "cameras.filmed": "more",
    }  # fmt: skip
    assert {name: goal_of(name) for name in goals} == goals


def test_the_suites_tolerances_win_and_the_last_of_them() -> None:
    suite = Suite.model_validate(
        {**SET, "tolerances": {"measures.*": "0.5", "foot:measures.foot_*": "2%", "time.*": {"relative": "3"}}}
    )
    assert tolerance_of("foot", "measures.foot_length_mm", suite) == Tolerance(relative=0.02)
    assert tolerance_of("other", "measures.foot_length_mm", suite) == Tolerance(absolute=0.5)
    assert tolerance_of("foot", "points.camera-1", suite) == Tolerance()
    assert Tolerance(absolute=0.1, relative=0.02).allows(-10.0) == pytest.approx(0.2)
    assert Tolerance(absolute=0.1, relative=0.02).allows(1.0) == 0.1


def test_twice_the_time_is_worse_and_a_busy_machine_is_not() -> None:
    accepted: dict[str, float | None] = {"time.surface": 100.0, "time.total": 400.0, "time.map": 2.0}
    suite = Suite.model_validate(SET)

    def verdicts(**times: float) -> list[str]:
        figures: dict[str, float | None] = {f"time.{name}": value for name, value in times.items()}
        return [one.verdict for one in judge_figures("foot", figures, accepted, {}, suite)]

    assert verdicts(map=7.9, surface=155.0, total=600.0) == ["same", "same", "same"]
    assert verdicts(map=2.0, surface=200.0, total=800.0) == ["same", "worse", "worse"]


ACCEPTANCE = Acceptance(
    reason='as "filmed": 1 % less', date=datetime(2026, 11, 20, 6, 30, tzinfo=UTC), by="ann", software="footscan 1"
)
TEXT = """\
# Accepted results, one figure a line. Written by 'footscan regress --accept REASON'; to be reviewed as a diff.
format: footscan.baseline/1
accepted:
  - reason: "as \\"filmed\\": 1 % less"
    date: 2026-11-20T06:30:00+00:00
    by: "ann"
    software: "footscan 1"
sets:
  empty: {}
  foot:
    accuracy.mean_mm: 0.1235
    measures.foot_length_mm: null
    memory.peak_mb: 512.3
    points.stripe: 98934
    surface.filled_share: 0.00001
"""


def test_the_baseline_is_made_to_be_read(tmp_path: Path) -> None:
    figures = {
        "foot": {
            "points.stripe": 98934, "accuracy.mean_mm": 0.12346, "memory.peak_mb": 512.349,
            "surface.filled_share": 1e-5, "measures.foot_length_mm": None,
        },
        "empty": {},
    }  # fmt: skip
    steps = {"foot": [AcceptedStep(step="extract-1", key="a" * 64, result="no result: finding")], "empty": []}
    path = tmp_path / "baseline.yaml"
    write_baseline(path, ACCEPTANCE, figures, steps)
    assert path.read_text() == TEXT
    assert steps_file(path) == tmp_path / "baseline.steps.yaml"
    assert read_steps(path).sets == steps
    later = ACCEPTANCE.model_copy(update={"reason": "later"})
    write_baseline(path, later, figures, steps)
    again = read_baseline(path)
    assert again is not None
    assert [one.reason for one in again.accepted] == ["later", ACCEPTANCE.reason]
    assert again.sets["foot"] == {
        "accuracy.mean_mm": 0.1235, "measures.foot_length_mm": None, "memory.peak_mb": 512.3, "points.stripe": 98934,
        "surface.filled_share": 1e-5,
    }  # fmt: skip


def test_a_baseline_that_breaks_its_format_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "baseline.yaml"
    assert read_baseline(path) is None
    path.write_text(TEXT.replace("98934", "many"))
    with pytest.raises(RefusedInput, match=r"baseline.yaml: sets.foot.points.stripe: .* found 'many' \(line 14"):
        read_baseline(path)


def a_pass(held: float, **ratios: float) -> Pass:
    steps = {
        name.replace("_", "-"): StepCost(name.partition("_")[0], ratio, 10 * ratio, 2.0 if "fuse" in name else 0.5)
        for name, ratio in ratios.items()
    }
    return Pass(steps, dict.fromkeys(steps, "a" * 64), peak_mb=held + 50, held_mb=held)


def test_of_several_passes_the_least_counts() -> None:
    first = [a_pass(100, extract_1=3, extract_2=5, fuse=9), a_pass(130, extract_1=2, extract_2=6, fuse=4)]
    second = [a_pass(90, extract_1=9, extract_2=9, fuse=3), a_pass(101, extract_1=9, extract_2=9, fuse=9)]
    assert cost_figures([first, second]) == {
        "time.extract": 2 + 5, "time.fuse": 3, "time.total": 10,
        "memory.extract_mb": 50, "memory.fuse_mb": 30, "memory.peak_mb": 140, "memory.kept_mb": 11,
    }  # fmt: skip
    assert keeps_most([first, second]) == "fuse"  # twice 2 MB, and twice 0.5 MB of each of two cameras
    assert "memory.kept_mb" not in cost_figures([first[:1]])
    assert unsteady([first], {"extract-1": "a" * 64, "fuse": "b" * 64, "report": "c" * 64}) == ["fuse"]
