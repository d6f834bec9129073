"""Advice on a scan of poor quality: camera and reason."""

from typing import Any

import pytest
from stand_in import measures_of, quality_of

from pipelines.console.pages.advice import advice
from schemas.measures import Measures
from schemas.quality import Quality
from schemas.recording import Recording


def told(measures: dict[str, Any], quality: dict[str, Any], recording: Recording | None = None) -> list[str]:
    return advice(Measures.model_validate(measures), Quality.model_validate(quality), recording)


def recorded(lost: int, latency: dict[str, Any] | None, warnings: list[str]) -> Recording:
    reasons = ["dropped: it never came", *["torn: ends too early"] * (lost - 1)][:lost]
    camera = {
        "id": 3, "device": "/dev/video3", "head": 2, "expected": 200, "stored": 200 - lost,
        "lost": [{"number": number, "reason": reason} for number, reason in enumerate(reasons)],
        "latency": latency, "position_sd_mm": 0.1, "largest_position_sd_mm": 0.2, "mm_per_s": 36.4,
        "frames_per_second": 18.2,
    }  # fmt: skip
    return Recording.model_validate(
        {
            "scanner": "S1",
            "started": "2026-11-20T10:00:00Z",
            "software": "footscan 1",
            "board": {"port": "p", "version": "1.1h", "settings_sha256": "0" * 64, "reports": 9, "report_sd_s": 0.002},
            "light": {"power": 0.8, "looks": 2},
            "passes": [{"cameras": [3], "reason": "all", "start_mm": 0, "end_mm": 400, "mm_per_s": 36, "seconds": 11}],
            "cameras": [camera],
            "warnings": warnings,
        }
    )


def test_a_good_scan_needs_nothing() -> None:
    assert told(measures_of("right"), quality_of()) == []


@pytest.mark.parametrize(
    ("cameras", "line"),
    [
        ({"largest_mm": 0.04}, None),
        (
            {"largest_mm": 0.41, "drifted": [3]},
            "Camera 3 had moved by 0.41 mm when the calibration was checked on 2026-11-24: calibrate anew. Put the "
            "reference object onto the glass and run 'footscan calibrate capture', then scan again.",
        ),
        (
            {"largest_mm": 0.04, "unseen": [7]},
            "Camera 7 could not be judged when the calibration was checked on 2026-11-24: check again. Put the "
            "reference object onto the glass and run 'footscan calibrate check' again.",
        ),
    ],
)
def test_a_calibration_that_does_not_hold_is_told_with_what_to_do(cameras: dict[str, Any], line: str | None) -> None:
    quality = quality_of() | {"calibration_check": {"checked": "2026-11-24", "age_days": 0, **cameras}}
    assert told(measures_of("right"), quality) == ([] if line is None else [line])


def test_a_blind_camera_is_named() -> None:
    [line] = told(measures_of("right"), quality_of(blind=5))
    assert line.startswith("Camera 5 saw no stripe in 200 frames. Look at its live picture")


def test_lost_frames_are_told_with_the_reason_of_most() -> None:
    assert told(measures_of("right"), quality_of(lost=10)) == [], "5 % may be lost"
    known = recorded(31, {"seconds": 0.05, "sd_s": 0.001}, ["the lid has no switch"])
    [line, warning] = told(measures_of("right"), quality_of(lost=31), known)
    assert line.startswith("Camera 3 lost 31 of 200 frames, 30 of them: torn: ends too early. Check its cable")
    assert warning == "the lid has no switch"


def test_a_latency_that_was_never_measured_is_told() -> None:
    [line] = told(measures_of("right"), quality_of(), recorded(0, None, []))
    assert line.startswith("The latency of camera 3 was never measured")


def test_of_cameras_that_disagree_the_farthest_is_suspected() -> None:
    quality = quality_of(apart_mm=0.24)
    assert told(measures_of("right"), quality) == []
    quality["fusion"]["pairs"][1]["after"] = {"median_mm": 0.6, "deviation_mm": 0.8, "rms_mm": 3.0}
    [line] = told(measures_of("right"), quality)  # camera 3 has this pair alone: sqrt(0.6^2 + 0.8^2)
    assert line.startswith("Camera 3 sees the skin 1.00 mm from where the others see it.")


def test_holes_and_what_was_filled() -> None:
    quality = quality_of(blind=None)
    quality["mesh"] |= {"filled_share": 0.31}
    quality["cameras"][6]["points"] = 10
    [line] = told(measures_of("right"), quality)
    assert line.startswith("31 % of the surface was seen by no camera. Camera 7 gave the fewest points.")
    quality["mesh"] |= {"holes": 2, "open_edges": 60}
    assert told(measures_of("right"), quality) == ["The surface is open (2 holes). Scan again."]


def test_measures_that_were_not_taken_are_named_with_their_reasons() -> None:
    measures = measures_of("right")
    for name in ("ball_girth", "foot_breadth"):
        measures["measures"][name] |= {"value": None, "status": "incomplete", "note": "the section is open"}
    [line] = told(measures, quality_of())
    assert line.startswith("Not taken: Foot breadth, Ball girth: the section is open. Is the leg bare")
    measures["finding"] = "the surface is no foot"
    assert told(measures, quality_of())[0].startswith("Nothing was measured (the surface is no foot).")
    assert len(told(measures, quality_of())) == 1


def test_a_side_that_may_be_wrong() -> None:
    [line] = told(measures_of("left") | {"side_note": "its form is that of a right foot"}, quality_of())
    assert line == "Its form is that of a right foot: was the right side chosen? Scan again if not."
