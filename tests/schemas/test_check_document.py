"""A check of a calibration: what does not add up is refused."""

from typing import Any

import pytest

from schemas.base.errors import RefusedInput
from schemas.base.json_files import validate
from schemas.calibration_check import CalibrationCheck

STEADY = {"camera": 1, "verdict": "steady", "points": 800, "shift_mm": [0.01, -0.02], "rms_mm": 0.03, "worst_mm": 0.1}
DRIFTED = {**STEADY, "camera": 3, "verdict": "drifted", "shift_mm": [0.0, 0.4], "rms_mm": 0.41, "worst_mm": 0.5}
UNSEEN = {"camera": 7, "verdict": "unseen", "reason": "not in the capture"}


def check(verdict: str, *cameras: dict[str, Any], **other: Any) -> dict[str, Any]:
    return {
        "checked": "2026-11-24T08:15:02+01:00",
        "software": "footscan 0.1",
        "calibration_sha256": "0" * 64,
        "tolerance_mm": 0.2,
        "sources": [{"name": "capture.yaml", "sha256": "1" * 64}],
        "verdict": verdict,
        "cameras": list(cameras),
        **other,
    }


@pytest.mark.parametrize(
    ("verdict", "cameras"),
    [
        ("steady", [STEADY]),
        ("drifted", [STEADY, DRIFTED, UNSEEN]),
        ("unseen", [STEADY, UNSEEN]),
    ],
)
def test_a_check_is_read_as_it_was_written(verdict: str, cameras: list[dict[str, Any]]) -> None:
    document = CalibrationCheck.model_validate(check(verdict, *cameras))
    assert document.checked.date().isoformat() == "2026-11-24"
    assert CalibrationCheck.model_validate_json(document.model_dump_json()) == document


@pytest.mark.parametrize(
    ("document", "complaint"),
    [
        (check("steady", STEADY, DRIFTED), "verdict 'steady', expected 'drifted' as the cameras have it"),
        (check("drifted", STEADY, UNSEEN), "verdict 'drifted', expected 'unseen' as the cameras have it"),
        (check("steady", STEADY, STEADY), r"expected each camera once, found \[1, 1\]"),
        (check("steady", STEADY | {"rms_mm": None}), "cameras.0: expected shift_mm, rms_mm and worst_mm"),
        (check("unseen", UNSEEN | {"reason": None}), "cameras.0: expected a reason and no figures"),
        (check("unseen", UNSEEN | {"rms_mm": 0.1}), "cameras.0: expected a reason and no figures"),
        (check("steady", STEADY | {"rms_mm": -0.1}), "cameras.0.rms_mm: input should be greater than or equal to 0"),
        (check("steady", STEADY, checked="2026-11-24T08:15:02"), "checked: .*timezone"),
        (check("steady", STEADY, calibration_sha256="abc"), "calibration_sha256: "),
        (check("steady", STEADY, tolerance_mm=0), "tolerance_mm: "),
        (check("steady"), "cameras: "),
        (check("steady", STEADY, scanner="../S1"), "scanner: expected 1 to 64 letters"),
    ],
)
def test_what_does_not_add_up_is_refused(document: dict[str, Any], complaint: str) -> None:
    with pytest.raises(RefusedInput, match=complaint):
        validate("calibration.check.json", CalibrationCheck, document)
