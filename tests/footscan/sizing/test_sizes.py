"""Sizes and widths beside figures worked out by hand and beside charts."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from footscan.sizing.sizes import foot_sizes, round_size, unrounded_size
from footscan.sizing.table import read_table
from schemas.feet import Foot
from schemas.sizes import FoundSize, FoundWidth, Sizes, SizeTable

MakeFoot = Callable[..., Foot]
INCH = 25.4
TABLE = read_table()


def size(sizes: Sizes, system: str) -> FoundSize:
    return next(entry for entry in sizes.sizes if entry.system == system)


def width(sizes: Sizes, system: str) -> FoundWidth:
    return next(entry for entry in sizes.widths if entry.system == system)


@pytest.mark.parametrize(
    ("length", "system", "unrounded", "marked"),
    [
        (230.0, "eu", 36.50, "36.5"),
        (230.0, "uk", 4.17, "4"),
        (230.0, "us_women_iso", 6.17, "6"),
        (230.0, "us_women", 6.67, "6.5"),
        (246.3, "eu", 38.95, "39"),
        (246.3, "uk", 6.09, "6"),
        (246.3, "us_women_iso", 8.09, "8"),
        (246.3, "us_women", 8.59, "8.5"),
        (260.0, "eu", 41.00, "41"),
        (260.0, "uk", 7.71, "7.5"),
        (260.0, "us_men", 8.71, "8.5"),
        (270.0, "eu", 42.50, "42.5"),
        (270.0, "uk", 8.89, "9"),
        (270.0, "us_men", 9.89, "10"),
        (270.0, "us_women", 11.39, "11.5"),
        (271.2, "eu", 42.68, "42.5"),
        (271.2, "uk", 9.03, "9"),
        (271.2, "us_men", 10.03, "10"),
        (290.0, "eu", 45.50, "45.5"),
        (290.0, "uk", 11.25, "11.5"),
        (290.0, "us_men", 12.25, "12.5"),
        (271.2, "mondopoint", 271.2, "270"),
        (272.6, "mondopoint", 272.6, "275"),
        (272.6, "china", 272.6, "275"),
        (272.6, "korea", 272.6, "275"),
        (272.6, "russia", 272.6, "275"),
        (272.6, "japan", 27.26, "27.5"),
        (232.4, "japan", 23.24, "23"),
    ],
)
def test_a_length_in_every_system(
    make_foot: MakeFoot, table: SizeTable, length: float, system: str, unrounded: float, marked: str
) -> None:
    sizes = size(foot_sizes(make_foot(foot_length=length), table), system)
    assert sizes.unrounded == pytest.approx(unrounded, abs=0.0051)
    assert sizes.size == marked
    assert sizes.decided_by == "foot_length"


def test_brannocks_size_1_is_a_foot_of_7_inches_and_two_thirds(table: SizeTable) -> None:
    assert unrounded_size((7 + 2 / 3) * INCH, table.sizes["us_men"]) == pytest.approx(1.0)
    assert unrounded_size(8 * INCH, table.sizes["us_men"]) == pytest.approx(2.0)
    assert unrounded_size(8 * INCH, table.sizes["us_women"]) == pytest.approx(3.5)


@pytest.mark.parametrize(
    ("inches", "uk", "us"),
    [
        (5.0, "5", "5.5"),  # 3 in - 10 = 5; 3 in - 9.667 = 5.333
        (7.0, "11", "11.5"),
        (23.7 / 3, "13.5", "1"),  # 13.70 and 14.03
        (23.8 / 3, "1", "1"),  # 13.80 and 14.13
        (8.0, "1", "1.5"),  # 14.00 and 14.33
        (9.0, "4", "4.5"),
    ],
)
def test_childrens_sizes_begin_again_after_thirteen_and_a_half(
    make_foot: MakeFoot, table: SizeTable, inches: float, uk: str, us: str
) -> None:
    sizes = foot_sizes(make_foot(foot_length=inches * INCH), table, "children")
    assert (size(sizes, "uk_children").size, size(sizes, "us_children").size) == (uk, us)


def test_after_the_restart_a_childs_uk_size_is_an_adults(make_foot: MakeFoot, table: SizeTable) -> None:
    sizes = foot_sizes(make_foot(foot_length=225.0), table)
    child, adult = size(sizes, "uk_children"), size(sizes, "uk")
    assert child.size == adult.size == "3.5"
    assert child.unrounded == pytest.approx(adult.unrounded)


@pytest.mark.parametrize(
    ("value", "rounded"), [(8.0, 8.0), (8.25, 8.0), (8.2501, 8.5), (8.5, 8.5), (8.75, 8.5), (8.7501, 9.0), (-0.3, -0.5)]
)
def test_the_next_half_size_is_taken_beyond_a_quarter(table: SizeTable, value: float, rounded: float) -> None:
    assert round_size(value, table.sizes["uk"]) == rounded


def test_rounding_can_be_told_to_go_up_always(table: SizeTable) -> None:
    upwards = table.sizes["eu"].model_copy(update={"up_beyond": 0.0})
    assert [round_size(value, upwards) for value in (42.0, 42.01, 42.5, 42.51)] == [42.0, 42.5, 42.5, 43.0]


def test_the_allowance_of_a_continental_size_can_be_another(table: SizeTable) -> None:
    """15 mm instead of two Paris points is a quarter of a size more."""
    fifteen = table.sizes["eu"].model_copy(update={"allowance_mm": 15.0})
    assert unrounded_size(260.0, fifteen) == pytest.approx(1.5 * 26.0 + 2.25)


@given(st.floats(80.0, 350.0), st.floats(0.0, 20.0), st.sampled_from(sorted(TABLE.sizes)))
def test_a_size_lies_next_to_the_unrounded_one_and_never_falls_with_length(
    length: float, more: float, name: str
) -> None:
    scale = TABLE.sizes[name]
    value = unrounded_size(length, scale)
    rounded = round_size(value, scale)
    assert value - scale.up_beyond - 1e-6 <= rounded <= value + scale.step - scale.up_beyond + 1e-6
    assert rounded / scale.step == pytest.approx(round(rounded / scale.step))
    assert round_size(unrounded_size(length + more, scale), scale) >= rounded


@pytest.mark.parametrize(
    ("length", "ball", "decided_by", "unrounded", "marked"),
    [
        (260.0, 192.4, "foot_length", 8.71, "8.5"),  # the arch of that very foot
        (260.0, 194.0, "foot_length", 8.71, "8.5"),  # 262.16 mm: 0.26 sizes more
        (260.0, 195.6, "ball_length", 9.22, "9"),  # 264.32 mm: 0.51 sizes more
        (260.0, 200.0, "ball_length", 9.92, "10"),  # 270.27 mm
        (260.0, 180.0, "foot_length", 8.71, "8.5"),
    ],
)
def test_a_long_arch_decides_the_us_size(
    make_foot: MakeFoot,
    table: SizeTable,
    length: float,
    ball: float,
    decided_by: str,
    unrounded: float,
    marked: str,
) -> None:
    sizes = foot_sizes(make_foot(foot_length=length, ball_length=ball), table)
    us = size(sizes, "us_men")
    assert (us.decided_by, us.size) == (decided_by, marked)
    assert us.unrounded == pytest.approx(unrounded, abs=0.0051)
    assert ("the arch decides" in (us.note or "")) == (decided_by == "ball_length")
    assert size(sizes, "eu").decided_by == "foot_length"


def test_mondopoint_has_the_breadth_behind_a_slash(make_foot: MakeFoot, table: SizeTable) -> None:
    assert size(foot_sizes(make_foot(foot_length=280.0, foot_breadth=110.2), table), "mondopoint").size == "280/110"
    without = size(foot_sizes(make_foot(foot_length=280.0), table), "mondopoint")
    assert (without.size, without.note) == ("280", "no foot_breadth was measured")


@pytest.mark.parametrize(
    ("us_size", "breadth", "letter"),
    [
        *((5, breadth, "D") for breadth in (83, 85, 87)),
        *((9, breadth, "D") for breadth in (95, 97, 99)),
        *((14, breadth, "D") for breadth in (111, 113)),
        (9, 97.2 + 4.7625, "E"),
        (9, 97.2 + 2 * 4.7625, "EE"),
        (9, 97.2 - 4.7625, "C"),
        (9, 97.2 - 2 * 4.7625, "B"),
    ],
)
def test_us_letters_beside_a_shops_chart(
    make_foot: MakeFoot, table: SizeTable, us_size: float, breadth: float, letter: str
) -> None:
    foot = make_foot(foot_length=(us_size + 22) / 3 * INCH, foot_breadth=float(breadth))
    assert width(foot_sizes(foot, table), "us").width == letter


def test_us_letters_of_soldiers(make_foot: MakeFoot, table: SizeTable) -> None:
    """ANSUR II, men: breadth 38.1 + 0.2352 length, residual 4.2 mm, gave 17 % C, 38 % D, 32 % E and 9 % EE."""
    grid = (np.arange(60) + 0.5) / 60
    normal = np.sqrt(2) * np.array([_inverse_erf(2 * share - 1) for share in grid])
    letters = [
        width(
            foot_sizes(make_foot(foot_length=length, foot_breadth=38.1 + 0.2352 * length + 4.2 * z), table), "us"
        ).width
        for length in 271.2 + 13.1 * normal[::3]
        for z in normal[::3]
    ]
    shares = {letter: letters.count(letter) / len(letters) for letter in ("C", "D", "E", "EE")}
    assert shares == pytest.approx({"C": 0.17, "D": 0.38, "E": 0.32, "EE": 0.09}, abs=0.03)


def _inverse_erf(value: float) -> float:
    low, high = -6.0, 6.0
    while high - low > 1e-9:
        middle = (low + high) / 2
        low, high = (middle, high) if math.erf(middle) < value else (low, middle)
    return low


@pytest.mark.parametrize(
    ("system", "length", "girth", "named"),
    [
        ("japan_men", 250, 243, "E"),
        ("japan_men", 260, 261, "EEE"),
        ("japan_men", 250, 240, "E"),  # from -3 to +2 mm about the middle
        ("japan_men", 250, 245, "E"),
        ("japan_men", 250, 239, "D"),
        ("japan_men", 250, 246, "EE"),
        ("japan_women", 235, 231, "E"),
        ("japan_women", 235, 237, "EE"),
        ("japan_women", 230, 228, "E"),
        ("china", 250, 243, "2.5"),
        ("china", 250, 239.5, "2"),
        ("china", 260, 264, "4.5"),  # 0.7 * 260 + 50.5 + 7 * 4.5
        ("eu", 700 / 3, 225, "F"),
        ("eu", 700 / 3, 230, "G"),
        ("eu", 700 / 3, 235, "H"),
        ("eu", 240, 230, "F"),  # EU 38
        ("uk", 787.4 / 3, 248, "F"),
        ("uk", 787.4 / 3, 254.35, "G"),
        ("uk", 812.8 / 3, 254.35, "F"),  # UK 9
        ("russia_men", 270, 246, "4"),  # 0.25 * 246 - 0.15 * 270 - 17 = 4
        ("russia_women", 240, 240, "8"),  # 60 - 36 - 16 = 8
    ],
)
def test_widths_by_girth(
    make_foot: MakeFoot, table: SizeTable, system: str, length: float, girth: float, named: str
) -> None:
    assert width(foot_sizes(make_foot(foot_length=length, ball_girth=girth), table), system).width == named


def test_the_unrounded_width_counts_steps_from_the_middle(make_foot: MakeFoot, table: SizeTable) -> None:
    sizes = width(foot_sizes(make_foot(foot_length=250.0, ball_girth=250.5), table), "japan_men")
    assert (sizes.middle, sizes.steps, sizes.width) == ("E", 1.25, "EE")


def test_beyond_a_scale_there_is_no_size_and_a_reason(make_foot: MakeFoot, table: SizeTable) -> None:
    small = foot_sizes(make_foot(foot_length=120.0, foot_breadth=20.0), table)
    assert size(small, "uk").size is None
    assert size(small, "uk").note == "below the scale, which begins at 1"
    assert size(small, "uk_children").size == "4"
    assert width(small, "us").width is None
    assert width(small, "us").note == "for feet of 195 to 350 mm"
    large = foot_sizes(make_foot(foot_length=270.0, ball_girth=400.0, foot_breadth=70.0), table)
    assert (width(large, "us").width, width(large, "us").note) == (None, "narrower than AAA")
    assert size(large, "uk_children").note == "above the scale, which ends at 19.5"
    assert (width(large, "japan_men").width, width(large, "japan_men").note) == (None, "wider than G")


def test_without_a_length_there_is_no_size_and_a_reason(make_foot: MakeFoot, table: SizeTable) -> None:
    gap = {"value": None, "status": "incomplete", "note": "the surface has a gap here"}
    sizes = foot_sizes(make_foot(foot_length=gap, ball_girth=250.0), table)
    assert {entry.size for entry in sizes.sizes} == {None}
    assert {entry.note for entry in sizes.sizes} == {"foot_length is incomplete: the surface has a gap here"}
    assert {entry.width for entry in sizes.widths} == {None}
    no_foot = foot_sizes(make_foot(finding="it is a block"), table)
    assert {entry.note for entry in no_foot.sizes} == {"nothing was measured: it is a block"}


@pytest.mark.parametrize("reading", [{"value": 26.5, "unit": "cm"}, {"value": 26.5}, {"value": -3.0}, {"value": 1e11}])
def test_what_is_no_length_in_mm_gives_no_size(
    make_foot: MakeFoot, table: SizeTable, reading: dict[str, object]
) -> None:
    sizes = foot_sizes(make_foot(foot_length=reading), table)
    assert {entry.size for entry in sizes.sizes} == {None}
    assert all("expected 60 to 500 mm" in (entry.note or "") for entry in sizes.sizes)


def test_a_misspelt_measure_is_told_of(make_foot: MakeFoot, table: SizeTable) -> None:
    sizes = foot_sizes(make_foot(foot_lenght=270.0), table)
    assert {entry.note for entry in sizes.sizes} == {"no foot_length was measured, but there is 'foot_lenght'"}


def test_an_uncertain_measure_is_told_of(make_foot: MakeFoot, table: SizeTable) -> None:
    uncertain = {"value": 250.0, "status": "uncertain", "note": "12 % filled"}
    sizes = foot_sizes(make_foot(foot_length=270.0, ball_girth=uncertain), table)
    assert width(sizes, "japan_men").width == "D"
    assert width(sizes, "japan_men").note == "ball_girth is uncertain: 12 % filled"
    assert size(sizes, "eu").note is None


def test_only_the_sizes_of_those_who_are_asked_for(make_foot: MakeFoot, table: SizeTable) -> None:
    sizes = foot_sizes(make_foot(foot_length=270.0), table, "women")
    systems = {entry.system for entry in sizes.sizes} | {entry.system for entry in sizes.widths}
    assert {"us_women", "us_women_iso", "japan_women", "eu", "us"} <= systems
    assert not {"us_men", "uk_children", "japan_men"} & systems
