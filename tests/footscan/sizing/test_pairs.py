"""Both feet of a person."""

from collections.abc import Callable

import pytest

from footscan.sizing.identity import refuse_other_patient
from footscan.sizing.pairs import compare_pair
from schemas.base.errors import RefusedInput
from schemas.feet import Foot
from schemas.pairs import Pair, PairRow
from schemas.sizes import SizeTable

MakeFoot = Callable[..., Foot]


def row(pair: Pair, measure: str) -> PairRow:
    return next(row for row in pair.rows if row.measure == measure)


def marked(pair: Pair) -> dict[str, str | None]:
    sizes = {one.system: one.size for one in pair.sizes.sizes}
    return sizes | {f"{one.system} width": one.width for one in pair.sizes.widths}


def test_the_longer_foot_decides_the_size_and_the_wider_one_the_width(make_foot: MakeFoot, table: SizeTable) -> None:
    left = make_foot("left", foot_length=270.0, foot_breadth=96.0, ball_girth=255.0)
    right = make_foot("right", foot_length=266.0, foot_breadth=100.0, ball_girth=261.0)
    pair = compare_pair(left, right, table)
    assert pair.decided_by == {
        "foot_length": "left",
        "ball_length": None,
        "foot_breadth": "right",
        "ball_girth": "right",
    }
    assert marked(pair)["mondopoint"] == "270/100"
    assert marked(pair)["eu"] == "42.5"  # of 270; 266 is 41.9
    assert marked(pair)["japan_men width"] == "EE"  # 261 at 270: 255 and 6
    length = row(pair, "foot_length")
    assert (length.left, length.right, length.difference, length.larger) == (270.0, 266.0, -4.0, "left")
    assert row(pair, "ball_girth").difference == 6.0
    assert row(pair, "ball_girth").larger == "right"


def test_feet_that_are_alike_have_no_larger_one(make_foot: MakeFoot, table: SizeTable) -> None:
    pair = compare_pair(make_foot("left", foot_length=270.0), make_foot("right", foot_length=270.0), table)
    assert pair.decided_by["foot_length"] is None
    assert (row(pair, "foot_length").larger, marked(pair)["eu"]) == (None, "42.5")


def test_a_difference_that_few_people_have_is_told(make_foot: MakeFoot, table: SizeTable) -> None:
    pair = compare_pair(
        make_foot("left", foot_length=260.0, ball_girth=240.0),
        make_foot("right", foot_length=266.1, ball_girth=248.1),
        table,
    )
    assert row(pair, "foot_length").usual_sds == 2.0  # 6.1 / 3.05
    assert row(pair, "foot_length").note is None
    assert row(pair, "ball_girth").usual_sds == pytest.approx(8.1 / 4, abs=0.01)
    assert row(pair, "ball_girth").note == "unusual: 2.0 standard deviations over people"


def test_uncertainties_add_up_as_squares(make_foot: MakeFoot, table: SizeTable) -> None:
    left = make_foot("left", foot_length={"value": 260.0, "uncertainty": 0.3}, ball_girth=240.0)
    right = make_foot(
        "right", foot_length={"value": 261.0, "uncertainty": 0.4}, ball_girth={"value": 1, "uncertainty": 1}
    )
    pair = compare_pair(left, right, table)
    assert row(pair, "foot_length").uncertainty == 0.5
    assert row(pair, "ball_girth").uncertainty is None


def test_what_one_foot_lacks_decides_nothing(make_foot: MakeFoot, table: SizeTable) -> None:
    gap = {"value": None, "status": "incomplete", "note": "a gap"}
    left = make_foot("left", foot_length=gap, ball_girth=250.0, toe_height=20.0)
    right = make_foot("right", foot_length=266.0, ball_girth=250.0)
    pair = compare_pair(left, right, table)
    assert {one.size for one in pair.sizes.sizes} == {None}
    assert {one.note for one in pair.sizes.sizes} == {"left foot: foot_length is incomplete: a gap"}
    assert row(pair, "foot_length").note == "left foot: incomplete: a gap"
    assert row(pair, "toe_height").note == "right foot: not measured"
    assert row(pair, "toe_height").difference is None
    assert row(pair, "ball_girth").larger is None  # they are equal


def test_how_high_the_scan_reached_is_no_difference_of_feet(make_foot: MakeFoot, table: SizeTable) -> None:
    left, right = (make_foot(side, foot_length=266.0, scan_height=90.0) for side in ("left", "right"))
    assert [row.measure for row in compare_pair(left, right, table).rows] == ["foot_length"]


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        ("right", "right", "a: is a right foot, expected a left one"),
        ("left", "left", "b: is a left foot, expected a right one"),
        ("right", "left", "a: is a right foot, expected the left one first"),
        ("unknown", "left", "b: is a left foot, expected a right one"),
    ],
)
def test_mixed_up_sides_are_refused(make_foot: MakeFoot, table: SizeTable, first: str, second: str, said: str) -> None:
    with pytest.raises(RefusedInput) as caught:
        compare_pair(make_foot(first, source="a"), make_foot(second, source="b"), table)
    assert str(caught.value) == said


def test_an_unknown_side_is_assumed_as_stated(make_foot: MakeFoot, table: SizeTable) -> None:
    left = make_foot("unknown", source="a", patient="P1", foot_length=1.0, side_note="looks like a right foot")
    right = make_foot("right", patient="P1")
    assert compare_pair(left, right, table).notes == [
        "a: side unknown, assumed as stated",
        "a: looks like a right foot",
    ]


def test_feet_of_two_people_are_refused(make_foot: MakeFoot, table: SizeTable) -> None:
    left, right = make_foot("left", patient="P1", source="a"), make_foot("right", patient="P2", source="b")
    with pytest.raises(RefusedInput, match=r"^b: is of patient P2, expected P1 as a is$"):
        refuse_other_patient(left, right)
    assert compare_pair(left, right, table).notes == ["of two patients: P1 and P2"]
    unknown = make_foot("right")
    refuse_other_patient(left, unknown)
    assert compare_pair(left, unknown, table).notes == ["patient unknown for one or both, assumed to be the same"]
