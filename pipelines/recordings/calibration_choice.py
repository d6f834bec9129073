"""Which calibration a scan is mapped with, where it names none itself: that of its scanner and its day."""

import datetime
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from footscan.recordings.scans import RecordedScan
from schemas.base.errors import RefusedInput
from schemas.workflow import Workflow


class CalibrationPlace(NamedTuple):
    """A calibration, and for which scans it is meant, see `ChosenCalibration`."""

    file: Path
    """The calibration file, or the folder of a capture."""
    scanner: str | None = None
    since: datetime.date | None = None
    is_capture: bool = False


def calibration_places(workflow: Workflow, base: Path) -> tuple[CalibrationPlace, ...]:
    """The calibrations that a workflow names, relative to `base`."""
    if workflow.calibration is not None:
        return (CalibrationPlace(base / workflow.calibration),)
    return tuple(
        CalibrationPlace(base / (one.file or one.capture or ""), one.scanner, one.since, one.capture is not None)
        for one in workflow.calibrations
    )


def choose_calibration(scan: RecordedScan, places: Sequence[CalibrationPlace]) -> CalibrationPlace:
    """Of those for the scan's scanner, or else of those for any, the last one that began before the scan's day ended.

    Raises
    ------
    RefusedInput
        There is none, or it cannot be told which.
    """
    scanner, day = scan.document.scanner, scan.document.day
    if not places:
        raise _refusal(scan, "names no calibration, expected one here or in the workflow", "calibration")
    own = [place for place in places if place.scanner is not None and place.scanner == scanner]
    fitting = own or [place for place in places if place.scanner is None]
    if not fitting:
        known = ", ".join(sorted({place.scanner for place in places if place.scanner is not None}))
        raise _refusal(
            scan, f"expected one that the workflow has a calibration for: {known}, found {scanner}", "scanner"
        )
    if day is None and any(place.since is not None for place in fitting):
        raise _refusal(scan, "is missing, expected one, for the workflow's calibrations differ by day", "date")
    begun = [place for place in fitting if place.since is None or (day is not None and place.since <= day)]
    if not begun:
        raise _refusal(scan, f"{day}, expected a day that the workflow has a calibration for", "date")
    return max(begun, key=lambda place: place.since or datetime.date.min)


def _refusal(scan: RecordedScan, problem: str, field: str) -> RefusedInput:
    return RefusedInput(scan.file, problem, field=field)
