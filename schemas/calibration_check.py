"""A check of a calibration: whether each camera still saw, on that day, what the calibration says. `*.check.json`."""

import datetime
from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, Field, model_validator

from schemas.base.model import Document, Pseudonym
from schemas.calibration import LARGEST, Number, Source
from schemas.frames import Sha256

Verdict = Literal["steady", "drifted", "unseen"]
Deviation = Annotated[float, Field(ge=0, le=2 * LARGEST)]
"""A distance in Y and Z of two `Number`, mm."""
Text = Annotated[str, Field(max_length=1000)]


class CameraCheck(Document):
    """The deviation of one camera from its calibration, measured on a reference object."""

    camera: Annotated[int, Field(ge=1)]
    verdict: Verdict
    """`steady`: `rms_mm` is within the tolerance; `drifted`: beyond it; `unseen`: the camera could not be checked."""
    reason: Text | None = None
    """Reason why the camera could not be checked, or a remark."""
    points: Annotated[int, Field(ge=0)] = 0
    """Number of compared points of the stripe."""
    shift_mm: tuple[Number, Number] | None = None
    """Mean error of the calibration in Y and Z; None if the camera could not be checked, as the two below."""
    rms_mm: Deviation | None = None
    """Root mean square distance of the error."""
    worst_mm: Deviation | None = None

    @model_validator(mode="after")
    def _figures_unless_unseen(self) -> Self:
        figures = (self.shift_mm, self.rms_mm, self.worst_mm)
        if self.verdict == "unseen":
            if figures != (None, None, None) or not self.reason:
                raise ValueError("expected a reason and no figures in mm for verdict 'unseen'")
        elif None in figures:
            raise ValueError(f"expected shift_mm, rms_mm and worst_mm for verdict {self.verdict!r}")
        return self


class CalibrationCheck(Document):
    """The content of a file such as calibration.check.json."""

    format: Literal["footscan.check/1"] = "footscan.check/1"
    checked: AwareDatetime
    """Time of the check, in the time zone of the scanner: its day is compared with the day of a scan."""
    scanner: Pseudonym | None = None
    """None if unknown."""
    software: Text
    """Name and version of the program that wrote it."""
    calibration_sha256: Sha256
    """Digest of the calibration file that was checked: the check says nothing about any other."""
    tolerance_mm: Annotated[float, Field(gt=0, le=100)]
    """Root mean square distance up to which a camera is steady."""
    sources: Annotated[list[Source], Field(max_length=100_000)]
    """The capture, its reference object and its films."""
    verdict: Verdict
    """`drifted` if any camera is; else `unseen` if any camera is; else `steady`."""
    cameras: Annotated[list[CameraCheck], Field(min_length=1, max_length=100)]

    @model_validator(mode="after")
    def _adds_up(self) -> Self:
        ids = [camera.camera for camera in self.cameras]
        if len(set(ids)) != len(ids):
            raise ValueError(f"expected each camera once, found {ids}")
        if self.verdict != (expected := verdict_in_all(self.cameras)):
            raise ValueError(f"verdict {self.verdict!r}, expected {expected!r} as the cameras have it")
        return self


def verdict_in_all(cameras: list[CameraCheck]) -> Verdict:
    """The verdict of a check from those of its cameras: `drifted` before `unseen` before `steady`."""
    verdicts = {camera.verdict for camera in cameras}
    return "drifted" if "drifted" in verdicts else "unseen" if "unseen" in verdicts else "steady"


class ScanCheck(Document):
    """What the check of a calibration says of the cameras of one scan.

    >>> check = ScanCheck(checked=datetime.date(2026, 11, 24), age_days=0, largest_mm=0.41, drifted=[3])
    >>> check.doubt
    'camera 3 had moved by 0.41 mm when the calibration was checked on 2026-11-24: calibrate anew'
    >>> ScanCheck(checked=datetime.date(2026, 11, 24), age_days=3, largest_mm=0.04).summary()
    'checked on 2026-11-24, 3 days before the scan: every camera was within 0.04 mm'
    """

    checked: datetime.date
    """Day of the check, by the clock of the scanner."""
    age_days: Annotated[int, Field(ge=0)] | None = None
    """Days from the check to the scan; None if the day of the scan is unknown."""
    largest_mm: Deviation | None = None
    """Largest root mean square deviation of a camera, mm, to 0.01; None if no camera was seen."""
    drifted: list[int] = Field(default_factory=list)
    """Cameras beyond the tolerance."""
    unseen: list[int] = Field(default_factory=list)
    """Cameras that could not be checked."""

    @model_validator(mode="after")
    def _has_figure(self) -> Self:
        if self.largest_mm is None and (self.drifted or not self.unseen):
            raise ValueError("largest_mm: expected a figure unless no camera was seen")
        return self

    @property
    def doubt(self) -> str | None:
        """The reason not to rely on the calibration, a sentence without a full stop; None if all cameras are steady."""
        then = f"when the calibration was checked on {self.checked}"
        doubts = []
        if self.drifted:
            by = f"{'up to ' * (len(self.drifted) > 1)}{self.largest_mm:.2f} mm"
            doubts.append(f"{_named(self.drifted)} had moved by {by} {then}: calibrate anew")
        if self.unseen:
            doubts.append(f"{_named(self.unseen)} could not be judged {then}: check again")
        return "; ".join(doubts) or None

    def summary(self, reckoned: str = "before the scan") -> str:
        """When the calibration was checked, and with which result, a phrase; `reckoned` follows an age in days."""
        days = self.age_days or 0
        age = f", {days} day{'s' * (days > 1)} {reckoned}" if days else ""
        return f"checked on {self.checked}{age}: {self._result}"

    @property
    def _result(self) -> str:
        if self.doubt is None:
            return f"every camera was within {self.largest_mm:.2f} mm"
        parts = [f"{_named(self.drifted)} had moved"] if self.drifted else []
        return ", ".join(parts + ([f"{_named(self.unseen)} could not be judged"] if self.unseen else []))


def _named(cameras: list[int]) -> str:
    if len(cameras) == 1:
        return f"camera {cameras[0]}"
    return f"cameras {', '.join(map(str, cameras[:-1]))} and {cameras[-1]}"
