"""The calibration of a scan as its quality.json names it."""

from pydantic import AwareDatetime

from schemas.calibration import Source


class UsedCalibration(Source):
    """The calibration that mapped the pixels of a scan."""

    created: AwareDatetime | None = None
    """Time of its creation; null if a step of the scan's own graph made it, and in files of earlier versions."""
    software: str | None = None
    """Name and version of the program that made it; null in files of earlier versions."""
