"""One foot at two times."""

import math
from collections.abc import Callable

import pytest

from footscan.sizing.change import change_over_time, smallest_real_change
from footscan.sizing.pairs import compare_pair
from schemas.base.errors import RefusedInput
from schemas.feet import Foot
from schemas.pairs import Change, ChangeRow
from schemas.sizes import SizeTable

MakeFoot = Callable[..., Foot]


def row(change: Change, measure: str) -> ChangeRow:
    return next(row for row in change.rows if row.measure == measure)


@pytest.mark.parametrize(
    ("name", "unit", "uncertainty", "limit"),
    [
        ("foot_length", "mm", None, 2.7719),  # 1.96 sqrt(2) 1.0
        ("ball_girth", "mm", None, 3.6034),  # 1.96 sqrt(2) 1.3
        ("ball_girth", "mm", 0.0, 3.6034),
        ("foot_length", "mm", math.sqrt(2), 3.92),  # 1.96 sqrt(2 + 2)
        ("ball_angle", "deg", 0.1, None),
        ("arch_index", "1", None, None),
    ],
)
def test_the_smallest_real_change(
    table: SizeTable, name: str, unit: str, uncertainty: float | None, limit: float | None
) -> None:
    assert smallest_real_change(name, unit, uncertainty, table.repeatability) == (
        limit and pytest.approx(limit, abs=1e-4)
    )


def test_what_has_changed_and_what_may_be_chance(make_foot: MakeFoot, table: SizeTable) -> None:
    earlier = make_foot(
        foot_length=250.0, foot_breadth=90.0, ball_girth=230.0, ball_angle={"value": 74.0, "unit": "deg"}
    )
    later = make_foot(foot_length=252.8, foot_breadth=92.7, ball_girth=226.0, ball_angle={"value": 76.0, "unit": "deg"})
    change = change_over_time(earlier, later, table)
    assert {row.measure: (row.difference, row.significant) for row in change.rows} == {
        "foot_length": (2.8, True),
        "foot_breadth": (2.7, False),
        "ball_girth": (-4.0, True),
        "ball_angle": (2.0, None),
    }
    assert change.days is None


def test_uncertain_measures_must_differ_more(make_foot: MakeFoot, table: SizeTable) -> None:
    earlier = make_foot(foot_length={"value": 250.0, "uncertainty": 0.6})
    later = make_foot(foot_length={"value": 252.9, "uncertainty": 0.8})
    length = row(change_over_time(earlier, later, table), "foot_length")
    assert length.uncertainty == 1.0
    assert length.limit == pytest.approx(1.96 * math.sqrt(3), abs=1e-4)
    assert length.significant is False


def test_days_between_scans(make_foot: MakeFoot, table: SizeTable) -> None:
    earlier, later = make_foot(scan="2026-02-28-R"), make_foot(scan="20260301_R")
    assert change_over_time(earlier, later, table).days == 1
    with pytest.raises(RefusedInput, match=r"is of 2026-03-01, expected the earlier one first \(2026-02-28\)$"):
        change_over_time(later, earlier, table)


def test_another_side_is_refused(make_foot: MakeFoot, table: SizeTable) -> None:
    with pytest.raises(RefusedInput, match=r"^b: is a left foot, expected a right one as a is$"):
        change_over_time(make_foot("right", source="a"), make_foot("left", source="b"), table)


def test_measures_that_cannot_be_compared(make_foot: MakeFoot, table: SizeTable) -> None:
    earlier = make_foot(foot_length=250.0, waist_girth=230.0, heel_girth={"value": 30, "unit": "cm"}, axis="toe2")
    later = make_foot(
        foot_length={"value": 260.0, "definition": "along another axis"},
        waist_girth={"value": None, "status": "incomplete"},
        heel_girth=310.0,
        axis="ball_center",
    )
    change = change_over_time(earlier, later, table)
    length, waist, heel = (row(change, name) for name in ("foot_length", "waist_girth", "heel_girth"))
    assert (length.difference, length.significant, length.note) == (10.0, None, "the definition changed")
    assert (waist.difference, waist.significant, waist.note) == (None, None, "later: incomplete")
    assert (heel.difference, heel.note) == (None, "in cm and in mm")
    assert "measured along different axes: toe2 and ball_center" in change.notes


@pytest.mark.parametrize(
    ("earlier", "later", "warning"),
    [
        ("unknown", "unknown", None),
        ("sitting", "sitting", None),
        ("sitting", "standing", "the posture is not the same (measures: sitting, measures: standing)"),
        ("unknown", "half_weight", "the posture is not known for both (measures: unknown, measures: half_weight)"),
        ("HWB", "half_weight", "the posture is not the same (measures: HWB, measures: half_weight)"),
    ],
)
def test_another_posture_may_be_the_difference(
    make_foot: MakeFoot, table: SizeTable, earlier: str, later: str, warning: str | None
) -> None:
    """For one foot at two times as for both feet."""
    left, right = make_foot("left", posture=earlier), make_foot("right", posture=later)
    for notes in (
        change_over_time(make_foot(posture=earlier), right, table).notes,
        compare_pair(left, right, table).notes,
    ):
        told = [note.partition(": a foot grows under load")[0] for note in notes if "posture" in note]
        assert told == ([] if warning is None else [warning])
