"""A recorded scan: `scan.yaml` and the films of its cameras."""

import datetime
import re
from collections.abc import Sequence
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from schemas.base.model import Document, Posture, Pseudonym, RelativePath, Side
from schemas.laser import Laser

MOST_CAMERA, MOST_LASERS = 64, 2
"""Largest number of a camera; largest number of laser planes of one head: the thesis's Table 3-1 has two below."""
CameraId = Annotated[int, Field(ge=1, le=MOST_CAMERA)]
LaserNumber = Annotated[int, Field(ge=1, le=MOST_LASERS)]


class Travel(Document):
    """X of frame k is `start_mm` + k * `step_mm`."""

    start_mm: Annotated[float, Field(ge=-1e5, le=1e5)]
    step_mm: Annotated[float, Field(gt=0, le=1000)]


class CameraSource(Document):
    """The place of the frames of one camera."""

    id: CameraId
    file: RelativePath
    """An AVI film, or a folder of PNG or JPEG frames in name order."""


class CameraFilm(CameraSource):
    """One camera of a scan."""

    background: RelativePath | None = None
    """A film, a folder of frames or an image with the laser off: one frame for all, or one for each film frame."""
    travel: Travel | None = None
    """The camera's own travel; default: the scan's."""
    positions: RelativePath | None = None
    """CSV with columns frame, x_mm for uneven steps; it wins over `travel`."""
    pass_number: Annotated[int, Field(ge=1, le=MOST_CAMERA)] = 1
    """Pass of the heads in which the camera filmed: a foot that moves is at one place for the cameras of one pass."""


class Scan(Document):
    """The content of scan.yaml."""

    format: Literal["footscan.scan/1"]
    patient: Pseudonym
    scan: Pseudonym
    side: Side
    travel: Travel | None = None
    calibration: RelativePath | None = None
    calibration_check: RelativePath | None = None
    """The check of the calibration that was in force when the scan was filmed."""
    scanner: Pseudonym | None = None
    """The scanner that filmed it: a workflow may have a calibration for each scanner."""
    posture: Posture = "unknown"
    """Posture of the person and load on the foot."""
    sex: Literal["female", "male"] | None = None
    """Sex of the person, for statistics."""
    age: Annotated[int, Field(ge=0, le=130)] | None = None
    """Age of the person at the scan, in whole years, for statistics."""
    laser: Laser | None = None
    """Colour of the laser in the pictures; default: found in the film of each camera."""
    date: datetime.date | None = None
    """Day of the scan; default: the day that the scan's name begins with, if any."""
    truth: RelativePath | None = None
    """Reference model in the scanner's own frame, for verification only."""
    cameras: Annotated[list[CameraFilm], Field(min_length=1)]

    @model_validator(mode="after")
    def _complete(self) -> Self:
        each_once([str(camera.id) for camera in self.cameras])
        for camera in self.cameras:
            if self.travel is None and camera.travel is None and camera.positions is None:
                raise ValueError(f"camera {camera.id} has no travel, expected travel or positions")
        return self

    @property
    def later_passes(self) -> dict[int, int]:
        """Camera -> number of its pass, of those that did not film in the first one."""
        return {camera.id: camera.pass_number for camera in self.cameras if camera.pass_number > 1}

    @property
    def day(self) -> datetime.date | None:
        """`date`, or the date in a name such as 2026-11-20-R."""
        if self.date is not None or not (named := re.match(r"\d{4}-\d{2}-\d{2}", self.scan)):
            return self.date
        try:
            return datetime.date.fromisoformat(named[0])
        except ValueError:
            return None


def each_once(cameras: Sequence[str]) -> None:
    """Refuse a name of a camera that is listed twice."""
    for name in cameras:
        if cameras.count(name) > 1:
            raise ValueError(f"camera {name} is listed twice, expected each id once")
