"""The table that a user edits: what is refused, and in which words."""

from collections.abc import Callable
from pathlib import Path

import pytest

from footscan.sizing.sizes import foot_sizes
from footscan.sizing.table import TABLE, read_table
from schemas.base.errors import RefusedInput
from schemas.feet import Foot


def edited(folder: Path, old: str, new: str) -> Path:
    text = TABLE.read_text(encoding="utf-8")
    assert old in text
    (folder / "sizes.yaml").write_text(text.replace(old, new, 1), encoding="utf-8")
    return folder / "sizes.yaml"


def test_fractions_are_exact() -> None:
    table = read_table()
    assert table.sizes["eu"].unit_mm == 20 / 3
    assert table.sizes["uk"].unit_mm == pytest.approx(8.4666667, abs=1e-7)
    assert table.widths["eu"].at_length_mm == pytest.approx(37 * 20 / 3 - 40 / 3)
    assert table.widths["uk"].at_length_mm == pytest.approx((8 + 25) * 25.4 / 3 - 50.8 / 3)


def test_the_widths_of_russia_are_the_formula_of_its_standard() -> None:
    """Fullness = 0.25 girth - 0.15 length - 17 of men, 16 of women."""
    for system, constant in (("russia_men", 17), ("russia_women", 16)):
        scale = read_table().widths[system]
        girth = scale.middle_mm + scale.per_mm * (280 - scale.at_length_mm)
        assert 0.25 * girth - 0.15 * 280 - constant == pytest.approx(int(scale.middle))


def test_an_edited_table_decides(tmp_path: Path, make_foot: Callable[..., Foot]) -> None:
    table = read_table(edited(tmp_path, "allowance_mm: 40/3", "allowance_mm: 15"))
    [eu] = [one for one in foot_sizes(make_foot(foot_length=260.0), table).sizes if one.system == "eu"]
    assert eu.unrounded == 41.25


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "unit_mm: 20/3",
            "unit_mm: 20/0",
            "sizes.eu.unit_mm: expected a number or a fraction such as 25.4/3, found '20/0'",
        ),
        ("unit_mm: 20/3", "unit_mm: -1", "sizes.eu.unit_mm: input should be greater than or equal to 0.001"),
        ("zero: 25", "zero: x", "sizes.uk.zero: input should be a valid number"),
        ("restart:", "restrat:", "sizes.uk_children.restrat: unknown field, did you mean"),
        ("middle: D", "middle: F", "widths.us: expected names that differ, among them middle, 'F', once"),
        (
            "measure: foot_breadth",
            "measure: breadth",
            "widths.us.measure: input should be 'foot_breadth' or 'ball_girth'",
        ),
        ("up_beyond: 2.5", "up_beyond: 5", "sizes.mondopoint: up_beyond is 5, expected less than step, 5"),
        ("smallest: 80", "smallest: 400", "sizes.mondopoint: largest is 350, expected more than smallest, 400"),
        ("confidence: recalled", "confidence: sure", "sizes.eu.confidence: input should be 'published'"),
        ("people: [men, women]", "people: [man]", "sizes.uk.people.0: input should be 'men', 'women' or 'children'"),
        ("to_mm: 15", "to_mm: 9", "lasts.purposes.everyday.length: to_mm is 9, expected at least from_mm, 10"),
        ("waist_girth:", "waist_grith:", "lasts.purposes.everyday.waist_grith"),
        ("format: footscan.sizes/1", "format: footscan.sizes/9", "format: input should be 'footscan.sizes/1'"),
        ("from_sizes: 0.5", "from_sizes: .inf", "arch.from_sizes"),
    ],
)
def test_a_mistake_is_named_in_one_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(RefusedInput) as caught:
        read_table(edited(tmp_path, old, new))
    assert str(caught.value).startswith(f"{tmp_path / 'sizes.yaml'}: {said}")
    assert "\n" not in str(caught.value)
