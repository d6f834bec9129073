"""The check of a calibration as an input of the graph: what runs again when a verdict changes, and what does not."""

import json
from typing import Any

import pytest
from checked import made_check

from pipelines.calibration_check import store_check

STEADY, DRIFTED = {1: 0.03, 5: 0.02}, {1: 0.03, 5: 0.41}
SENTENCE = "camera 5 had moved by 0.41 mm when the calibration was checked on 2026-11-24: calibrate anew"


@pytest.fixture
def dated(done: Any) -> Any:
    """A run archive whose scan has a date."""
    document = done.scan / "scan.yaml"
    document.write_text(document.read_text().replace("cameras:", "date: 2026-11-24\ncameras:"))
    assert done.plan() == (21, {})
    return done


def store(archive: Any, when: str, off_mm: dict[int, float | None]) -> None:
    calibration = archive.root / "calibration.json"
    store_check(calibration, made_check(calibration, when, off_mm))


def to_run(archive: Any) -> set[str]:
    return set(archive.plan()[1])


def result(archive: Any, name: str) -> dict[str, Any]:
    return dict(json.loads((archive.results / name).read_text()))


def test_a_steady_check_is_reported_and_leaves_the_measures_alone(dated: Any) -> None:
    before = (dated.results / "measures.json").read_bytes()
    assert result(dated, "quality.json")["calibration_check"] is None
    assert "calibration was not checked" in (dated.results / "report.html").read_text()
    store(dated, "2026-11-22T08:00:00+01:00", STEADY)
    _, reasons = dated.plan()
    assert reasons == {
        "quality": "input calibration-check changed", "quality.json": "waits for quality",
        "report": "waits for quality.json",
    }  # fmt: skip
    [scan], ran = dated.run()
    assert (scan.problem, ran) == (None, {"quality", "quality.json", "report"})
    assert (dated.results / "measures.json").read_bytes() == before
    assert result(dated, "quality.json")["calibration_check"] == {
        "checked": "2026-11-22", "age_days": 2, "largest_mm": 0.03, "drifted": [], "unseen": []
    }  # fmt: skip
    summary = "checked on 2026-11-22, 2 days before the scan: every camera was within 0.03 mm"
    assert summary in (dated.results / "report.html").read_text()
    assert dated.plan() == (21, {})


def test_a_drifted_check_makes_the_measures_uncertain(dated: Any) -> None:
    store(dated, "2026-11-24T08:00:00+01:00", DRIFTED)
    assert to_run(dated) == {"measure", "quality", "quality.json", "sizes.json", "report"}
    [scan], ran = dated.run()
    assert (scan.problem, ran) == (None, {"measure", "quality", "quality.json", "sizes.json", "report"})
    measures = result(dated, "measures.json")
    assert measures["doubts"] == [SENTENCE]
    statuses = {measure["status"] for measure in measures["measures"].values()}
    assert statuses <= {"uncertain", "incomplete"}
    assert "uncertain" in statuses
    assert SENTENCE.capitalize() in (dated.results / "report.html").read_text()
    assert dated.plan() == (21, {})


def test_keys_do_not_change_with_what_does_not_matter(dated: Any) -> None:
    """Another time of the day, other digits and other cameras, a later day: the verdict of this scan is the same."""
    store(dated, "2026-11-24T08:00:00+01:00", DRIFTED)
    dated.run()
    store(dated, "2026-11-24T09:30:00+01:00", {1: 0.1, 5: 0.4149, 7: 0.9, 8: None})
    assert dated.plan() == (21, {})
    store(dated, "2026-11-25T08:00:00+01:00", STEADY)
    assert dated.plan() == (21, {})


def test_keys_change_with_the_verdict_and_come_back_with_it(dated: Any) -> None:
    never_checked = (dated.results / "measures.json").read_bytes()
    store(dated, "2026-11-24T08:00:00+01:00", DRIFTED)
    dated.run()
    store(dated, "2026-11-24T12:00:00+01:00", STEADY)
    only = {"quality", "quality.json", "report"}
    assert to_run(dated) == only, "the measures are those of a scan that was never checked"
    dated.run()
    assert (dated.results / "measures.json").read_bytes() == never_checked
    store(dated, "2026-11-24T13:00:00+01:00", {1: 0.03, 5: None})
    assert to_run(dated) == {"measure", "quality", "quality.json", "sizes.json", "report"}
    for path in dated.root.glob("calibration.check*"):
        path.unlink()
    assert dated.plan() == (21, {})


def test_another_calibration_is_not_judged_by_the_check_of_the_former(dated: Any) -> None:
    store(dated, "2026-11-24T08:00:00+01:00", DRIFTED)
    path = dated.root / "calibration.json"
    path.write_text(path.read_text() + "\n")
    assert to_run(dated) == {"quality", "quality.json", "report"}, "the digest of the calibration alone has changed"
    dated.run()
    assert result(dated, "quality.json")["calibration_check"] is None


def test_a_scan_carries_its_own_check(dated: Any) -> None:
    check = made_check(dated.root / "calibration.json", "2026-11-24T08:00:00+01:00", DRIFTED)
    (dated.scan / "check.json").write_text(check.model_dump_json())
    document = dated.scan / "scan.yaml"
    document.write_text(document.read_text().replace("cameras:", "calibration_check: check.json\ncameras:"))
    store(dated, "2026-11-24T12:00:00+01:00", STEADY)
    dated.run()
    assert result(dated, "measures.json")["doubts"] == [SENTENCE]


def test_a_damaged_check_is_refused_in_one_line(dated: Any) -> None:
    store(dated, "2026-11-24T08:00:00+01:00", STEADY)
    path = dated.root / "calibration.check.json"
    path.write_text(path.read_text().replace("footscan.check/1", "footscan.check/2"))
    [scan], ran = dated.run()
    assert (scan.kind, ran) == ("refused", set())
    assert scan.problem.startswith(f"{path}: format: input should be 'footscan.check/1', found 'footscan.check/2'")
