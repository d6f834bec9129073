"""The warnings of a scan: each names what is wrong and says what to do."""

from typing import Any

import pytest
from made_up_scan import measures_of, quality_of, recorded

from footscan.cloud.contact import moved_warning
from footscan.measure.frame.glass import glass_doubt
from footscan.report.scan_warnings import scan_warnings, warnings_of
from schemas.glass import GlassPlane
from schemas.measures import Measures
from schemas.quality import Quality
from schemas.recording import Recording

HEADS = "a head lies 3.10 mm off: film the body"


def told(measures: dict[str, Any], quality: dict[str, Any], recording: Recording | None = None) -> list[str]:
    return scan_warnings(Measures.model_validate(measures), Quality.model_validate(quality), recording)


def test_a_good_scan_needs_nothing() -> None:
    assert told(measures_of("right"), quality_of()) == []


@pytest.mark.parametrize(
    ("cameras", "line"),
    [
        ({"largest_mm": 0.04}, None),
        (
            {"largest_mm": 0.41, "drifted": [3]},
            "Camera 3 had moved by 0.41 mm when the calibration was checked on 2026-11-24: calibrate anew. All "
            "measures are uncertain. Put the reference object onto the glass and run 'footscan calibrate capture', "
            "then scan again.",
        ),
        (
            {"largest_mm": 0.04, "unseen": [7]},
            "Camera 7 could not be judged when the calibration was checked on 2026-11-24: check again. All "
            "measures are uncertain. Put the reference object onto the glass and run 'footscan calibrate check' again.",
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
    assert warning == "The lid has no switch."


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
    assert told(measures_of("right"), quality) == [
        "The surface is open (2 holes): see that no camera is left out or covered, then scan again."
    ]


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


def test_all_that_steps_found_is_in_the_list() -> None:
    """A sentence that a step has written is shown once, whole, and ends with what to do."""
    glass = GlassPlane(below_foot_mm=3.5, largest_mm=3.6, corrected=True)
    doubts = [doubt for doubt in (glass_doubt(glass), "90 % of the sole was filled: uncover the cameras") if doubt]
    quality = quality_of() | {
        "warnings": [*moved_warning(glass, 0.5)],
        "heads": {
            "doubt": HEADS,
            "warnings": ["heads were corrected; film the body"],
        },
    }
    quality["fusion"]["warnings"] = ["camera 2 deviates by 2.00 mm; check it"]
    lines = told(measures_of("right") | {"doubts": [*doubts, HEADS]}, quality)
    assert lines == [
        "A head lies 3.10 mm off: film the body. All measures are uncertain. Then scan again.",
        "The glass is up to 3.6 mm from where it was calibrated, more than can be corrected safely: calibrate anew. "
        "All measures are uncertain.",
        "90 % of the sole was filled: uncover the cameras. All measures are uncertain.",
        "The sole stands 3.50 mm above the calibrated glass: the plate was moved since the calibration; calibrate "
        "anew.",
        "Heads were corrected; film the body.",
        "Camera 2 deviates by 2.00 mm; check it.",
    ]


def test_uncertain_measures_are_named_unless_all_are_for_one_reason() -> None:
    measures = measures_of("right")
    for name in ("ball_girth", "foot_breadth"):
        measures["measures"][name] |= {"status": "uncertain", "note": "ball by a fallback"}
    [line] = told(measures, quality_of())
    assert line == (
        "Uncertain: Foot breadth, Ball girth: ball by a fallback. Do not rely on them alone: the report shows what "
        "errs most. Mend that and scan again, or set a landmark that a note names by hand (footscan edit)."
    )
    measures["measures"]["ball_girth"]["note"] = "tilted by 9 degrees"
    [line] = told(measures, quality_of())
    assert line.startswith("Uncertain: Foot breadth (ball by a fallback); Ball girth (tilted by 9 degrees). Do not")
    for measure in measures["measures"].values():
        measure |= {"status": "uncertain", "note": "a hand at the heel"}
    [line] = told(measures | {"things": ["a hand at the heel"]}, quality_of())
    assert line.startswith("A hand at the heel. All measures are uncertain. Take everything away")


@pytest.mark.parametrize(
    ("doubt", "first_moments", "todo"),
    [
        (HEADS, {}, "Then scan again."),
        ("a head lost steps: home it, then scan again", {}, ""),
        (HEADS, {"5": 260}, "If the foot moved between the passes, scan again first."),
    ],
)
def test_heads_that_are_elsewhere(doubt: str, first_moments: dict[str, int], todo: str) -> None:
    quality = quality_of() | {
        "heads": {"points": 9, "comparisons": 9, "doubt": doubt},
        "movement": {"first_moments": first_moments},
    }
    [line] = told(measures_of("right") | {"doubts": [doubt]}, quality)
    assert line == f"{doubt[0].upper()}{doubt[1:]}. All measures are uncertain. {todo}".rstrip()


def test_a_doubt_about_the_whole_scan_is_listed_once() -> None:
    doubt = "the foot moved slowly, by 0.5 mm (root mean square): scan again"
    [line] = told(measures_of("right") | {"doubts": [doubt]}, quality_of() | {"warnings": [doubt]})
    assert line == f"T{doubt[1:]}. All measures are uncertain."


def test_the_stored_list_is_shown_and_an_older_file_gets_one() -> None:
    measures = Measures.model_validate(measures_of("right"))
    older = Quality.model_validate(quality_of(blind=5))
    assert warnings_of(measures, older) == scan_warnings(measures, older) != []
    assert warnings_of(measures, older.model_copy(update={"scan_warnings": ["as stored"]})) == ["as stored"]
