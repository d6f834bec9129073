"""The choice of the calibration for a scan that names none itself: that of its scanner and its day."""

import datetime
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from footscan.recordings.scans import RecordedScan
from schemas.base.errors import RefusedInput
from schemas.workflow import Workflow


class CalibrationPlace(NamedTuple):
    """A calibration, and the scans that it is meant for, see `ChosenCalibration`."""

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
        CalibrationPlace(
            base / (chosen.file or chosen.capture or ""), chosen.scanner, chosen.since, chosen.capture is not None
        )
        for chosen in workflow.calibrations
    )


def choose_calibration(scan: RecordedScan, places: Sequence[CalibrationPlace]) -> CalibrationPlace:
    """The latest calibration up to the scan's day, among those for its scanner, or else among those for any scanner.

    Raises
    ------
    RefusedInput
        No calibration fits, or the scan's day is unknown and the calibrations differ by day.
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
