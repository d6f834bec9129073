"""How a scan was filmed: `recording.json` beside its scan.yaml, for whoever asks how far its X is to be trusted."""

from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, Field, model_validator

from schemas.base.model import Document, Pseudonym
from schemas.frames import Sha256
from schemas.rig import MOST_HEADS, HeadNumber, Millimetres, Milliseconds, RigLatency, Share
from schemas.scan import CameraId

Count = Annotated[int, Field(ge=0)]
Deviation = Annotated[float, Field(ge=0)]
Text = Annotated[str, Field(max_length=1000)]


class RecordedBoard(Document):
    """The controller of heads and lasers."""

    port: Text
    version: Text
    """Version that its firmware reports."""
    settings_sha256: Sha256
    """Of its settings, as it lists them."""
    reports: Count
    """Number of position reports while the heads travelled."""
    report_sd_s: Deviation
    """Standard deviation of the time that such a report stands for, root mean square."""
    lost_steps_mm: Annotated[tuple[float, ...], Field(min_length=1, max_length=MOST_HEADS)] | None = None
    """How far heads 1, 2, ... were off along X after the last travel, felt at their home switches; to 0.1 mm."""


class RecordedPass(Document):
    """One travel of the heads, with some of the cameras."""

    cameras: Annotated[list[int], Field(min_length=1)]
    reason: Text
    """Reason for this choice of cameras."""
    start_mm: Millimetres
    end_mm: Millimetres
    mm_per_s: Annotated[float, Field(gt=0)]
    """Requested speed."""
    seconds: Deviation
    """Duration of the travel."""


class RecordedLight(Document):
    """Laser power, and why it was chosen; exposures stand with the cameras."""

    power: Share
    looks: Count
    """Number of test frames of a camera."""
    is_measured: bool = True
    """False where power and exposure were given by hand."""


class LeftOut(Document):
    """A frame that was filmed, or should have been, and is not in the film, or is a gap in it."""

    number: Count
    """On the camera's own clock."""
    reason: Text


class RecordedCamera(Document):
    """One camera's part."""

    id: CameraId
    device: Text
    """Its stable name or URL."""
    name: Text | None = None
    """Name that it reports."""
    head: HeadNumber
    exposure_ms: Milliseconds | None = None
    """None if it cannot be set or read."""
    gain: Share | None = None
    light_reason: Text | None = None
    """Reason for this exposure."""
    not_fixed: list[Text] = Field(default_factory=list)
    """Controls that the camera lacks, or set to another value than requested."""

    expected: Count
    """Exposures while its head travelled."""
    stored: Count
    """Frames in the film that have a picture."""
    lost: list[LeftOut]
    """Gaps in the film: they have a place, but no picture."""
    left_out: list[LeftOut] = Field(default_factory=list)
    """Frames that are not in the film at all: the head stood, or its place is not known."""
    latency: RigLatency | None
    """None where it was never measured: X is then off by the latency times the speed."""
    position_sd_mm: Deviation | None
    """Standard deviation of a frame's X, root mean square over the film; of the latency's, all frames have the same."""
    largest_position_sd_mm: Deviation | None
    mm_per_s: float
    """Median speed of its head at the frames; negative towards -X."""
    frames_per_second: Annotated[float, Field(gt=0)]
    """Of the camera's own clock."""

    @model_validator(mode="after")
    def _adds_up(self) -> Self:
        if self.stored + len(self.lost) > self.expected + len(self.left_out):
            raise ValueError(
                f"{self.stored} stored and {len(self.lost)} lost of {self.expected} expected frames, expected no more"
            )
        return self


class Recording(Document):
    """The content of recording.json."""

    format: Literal["footscan.recording/1"] = "footscan.recording/1"
    scanner: Pseudonym
    started: AwareDatetime
    software: Text
    """Version of footscan."""
    board: RecordedBoard
    light: RecordedLight
    passes: Annotated[list[RecordedPass], Field(min_length=1)]
    cameras: Annotated[list[RecordedCamera], Field(min_length=1)]
    warnings: list[Text] = Field(default_factory=list)
    """Warnings that were shown to the operator."""
