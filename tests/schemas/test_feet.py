"""Measures as others write them down."""

import json
from datetime import date
from pathlib import Path

import pytest

from schemas.base.errors import RefusedInput
from schemas.base.json_files import read_json
from schemas.feet import Foot
from schemas.measures import Measure, Measures

PLAIN = {
    "format": "footscan.measures/1",
    "unit": "mm",
    "side": "right",
    "measures": {"foot_length": {"value": 265.1, "unit": "mm", "status": "ok"}},
}


def foot(tmp_path: Path, **changes: object) -> Foot:
    (tmp_path / "measures.json").write_text(json.dumps(PLAIN | changes))
    return read_json(tmp_path / "measures.json", Foot)


def test_the_least_that_measures_need(tmp_path: Path) -> None:
    plain = foot(tmp_path)
    assert (plain.side, plain.measures["foot_length"].value) == ("right", 265.1)
    assert foot(tmp_path, colour="blue", measures={"foot_length": {"value": 1, "by": "tape"}}).measures


def test_our_own_measures_are_read(tmp_path: Path) -> None:
    ours = Measures(
        side="left",
        axis="toe2",
        transform=[[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]],
        measures={
            "ball_girth": Measure(value=None, unit="mm", status="incomplete", definition="tape", note="a gap"),
            "foot_length": Measure(value=265.1, unit="mm", status="ok", definition="longest", uncertainty=0.2),
        },
        side_note="it looks like a right foot",
        finding="half of a foot",
    )
    (tmp_path / "measures.json").write_text(ours.model_dump_json())
    read = read_json(tmp_path / "measures.json", Foot)
    assert (read.side, read.axis, read.finding) == ("left", "toe2", "half of a foot")
    assert read.side_note == "it looks like a right foot"
    assert read.measures["foot_length"].uncertainty == 0.2
    assert read.measures["ball_girth"].model_dump() == {
        "value": None,
        "unit": "mm",
        "status": "incomplete",
        "definition": "tape",
        "note": "a gap",
        "uncertainty": None,
    }


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"format": "footscan.quality/1"}, "expected the format footscan.measures/1, found 'footscan.quality/1'"),
        ({"format": None}, "expected the format footscan.measures/1, found 'None'"),
        ({"unit": "cm"}, "unit: input should be 'mm', found 'cm'"),
        ({"side": "both"}, "side: input should be 'right', 'left' or 'unknown', found 'both'"),
        ({"measures": {"foot_length": {"unit": "mm"}}}, "measures.foot_length.value: is missing, expected a value"),
        (
            {"measures": {"foot_length": {"value": "long"}}},
            "measures.foot_length.value: input should be a valid number",
        ),
        ({"measures": {"foot_length": {"value": 1e300}}}, "measures.foot_length.value: input should be less than"),
        ({"measures": 3}, "measures: input should be a valid dictionary"),
    ],
)
def test_what_are_no_measures_is_refused(tmp_path: Path, changes: dict[str, object], said: str) -> None:
    with pytest.raises(RefusedInput) as caught:
        foot(tmp_path, **changes)
    assert str(caught.value).startswith(f"{tmp_path / 'measures.json'}: {said}")


@pytest.mark.parametrize(
    ("scan", "day"),
    [
        ("2026-11-20-R", date(2026, 11, 20)),
        ("R_20261120", date(2026, 11, 20)),
        ("visit2-2026-11-20", date(2026, 11, 20)),
        ("2026-13-40-R", None),
        ("1234567890", None),
        ("demo-R", None),
        (None, None),
    ],
)
def test_the_name_of_a_scan_tells_its_day(tmp_path: Path, scan: str | None, day: date | None) -> None:
    assert foot(tmp_path, scan=scan).date == day
