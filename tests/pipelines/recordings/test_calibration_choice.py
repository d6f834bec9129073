"""Scans that name no calibration get that of their scanner and their day."""

from pathlib import Path

import pytest

from footscan.recordings.scans import RecordedScan
from pipelines.recordings.calibration_choice import calibration_places, choose_calibration
from schemas.base.errors import RefusedInput
from schemas.base.json_files import validate
from schemas.scan import Scan
from schemas.workflow import Workflow

PLACES = [
    {"file": "any.json"},
    {"file": "a1.json", "scanner": "A", "since": "2026-05-01"},
    {"file": "a2.json", "scanner": "A", "since": "2026-09-01"},
    {"file": "b.json", "scanner": "B"},
]


def workflow(calibrations: list[dict[str, str]], **fields: object) -> Workflow:
    values = {"format": "footscan.workflow/1", "archive": "a", "results": "r", "calibrations": calibrations} | fields
    return validate("workflow.yaml", Workflow, values)


def chosen(calibrations: list[dict[str, str]], name: str = "one", **fields: str) -> str:
    document = {
        "format": "footscan.scan/1",
        "patient": "P1",
        "scan": name,
        "side": "left",
        "travel": {"start_mm": 0, "step_mm": 2},
        "cameras": [{"id": 1, "file": "cam1.avi"}],
    } | fields
    scan = RecordedScan(Path("folder"), Path("archive"), validate("scan.yaml", Scan, document))
    return choose_calibration(scan, calibration_places(workflow(calibrations), Path("base"))).file.name


@pytest.mark.parametrize(
    ("fields", "file"),
    [
        ({}, "any.json"),
        ({"scanner": "C"}, "any.json"),
        ({"scanner": "B"}, "b.json"),
        ({"scanner": "B", "date": "1999-01-01"}, "b.json"),
        ({"scanner": "A", "date": "2026-05-01"}, "a1.json"),
        ({"scanner": "A", "date": "2026-08-31"}, "a1.json"),
        ({"scanner": "A", "date": "2026-09-01"}, "a2.json"),
        ({"scanner": "A", "name": "2026-08-31-R"}, "a1.json"),
        ({"scanner": "A", "name": "2026-08-31-R", "date": "2027-01-01"}, "a2.json"),
    ],
)
def test_scanner_and_day_choose(fields: dict[str, str], file: str) -> None:
    assert chosen(PLACES, **fields) == file


@pytest.mark.parametrize(
    ("places", "fields", "told"),
    [
        ([], {}, "calibration: names no calibration"),
        (PLACES[1:], {"scanner": "C"}, "scanner: expected one that the workflow has a calibration for: A, B, found C"),
        (PLACES, {"scanner": "A"}, "date: is missing"),
        (PLACES, {"scanner": "A", "name": "2026-13-31-R"}, "date: is missing"),
        (PLACES, {"scanner": "A", "date": "2026-04-30"}, "date: 2026-04-30, expected a day"),
    ],
)
def test_no_calibration_fits(places: list[dict[str, str]], fields: dict[str, str], told: str) -> None:
    with pytest.raises(RefusedInput) as caught:
        chosen(places, **fields)
    assert str(caught.value).startswith(f"folder/scan.yaml: {told}")


def test_two_for_the_same_scans_are_refused() -> None:
    with pytest.raises(RefusedInput, match="two of B since the start"):
        workflow([*PLACES, {"file": "c.json", "scanner": "B"}])
    with pytest.raises(RefusedInput, match="calibration and calibrations exclude each other"):
        workflow(PLACES, calibration="c.json")


@pytest.mark.parametrize(("fields", "found"), [({}, "neither"), ({"file": "a.json", "capture": "a"}, "both")])
def test_a_calibration_is_a_file_or_a_capture(fields: dict[str, str], found: str) -> None:
    with pytest.raises(RefusedInput, match=f"expected exactly one of file and capture, found {found}"):
        workflow([{"scanner": "A"} | fields])
    captured = calibration_places(workflow([{"capture": "a"}, {"file": "b.json", "scanner": "B"}]), Path("base"))
    assert [(place.file, place.is_capture) for place in captured] == [
        (Path("base/a"), True), (Path("base/b.json"), False)
    ]  # fmt: skip


def test_one_calibration_is_for_all() -> None:
    one = workflow([], calibration="c.json")
    assert [place.file for place in calibration_places(one, Path("base"))] == [Path("base/c.json")]
