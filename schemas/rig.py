"""A scanner that films: its heads, its cameras, and how it is run. `rig.yaml`, one for each scanner."""

from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from schemas.base.model import Document, Pseudonym, RelativePath
from schemas.mounting import Stands
from schemas.scan import MOST_LASERS, CameraId, LaserNumber

AXES = 3
"""Number of axes of a Grbl 1.1 board that it moves together."""
MOST_HEADS = 4
"""Two on each side of the foot, or one and three: more than a rail has room for is not foreseen. Chosen by hand."""
MOST_CAMERAS = 12
"""Largest number of cameras of a scanner that was tried: on the virtual board, and in worlds. Chosen by hand."""

HeadNumber = Annotated[int, Field(ge=1, le=MOST_HEADS)]
Millimetres = Annotated[float, Field(ge=-1e4, le=1e4)]
Share = Annotated[float, Field(ge=0, le=1)]
Milliseconds = Annotated[float, Field(gt=0, le=1000)]
Positive = Annotated[float, Field(gt=0, le=1e5)]
Port = Annotated[str, Field(min_length=1, max_length=1000)]

USUAL_HEADS: dict[int, int] = {1: 1, 2: 1, 3: 2, 4: 2, 5: 3, 6: 3, 7: 3, 8: 3}
"""Head of each camera that says none: two cameras on each of the upper heads, four on the one below."""


def _one_of(*allowed: int) -> AfterValidator:
    """Whole numbers that YAML gives as text are no literals yet."""

    def check(value: int) -> int:
        if value not in allowed:
            raise ValueError(f"expected {' or '.join(map(str, allowed))}, found {value}")
        return value

    return AfterValidator(check)


class RigLaser(Document):
    """One laser plane of a head."""

    offset_mm: Annotated[float, Field(ge=-200, le=200)] = 0.0
    """X of the plane minus X of its head."""


class RigHead(Document):
    """How the rail of a head lies: X of the head is `offset_mm` + `direction` * machine position of its axis."""

    offset_mm: Millimetres = -20.0
    """X at which its home switch trips; it aligns the heads."""
    direction: Annotated[int, _one_of(-1, 1)] = -1
    """-1 where X grows away from the home switch."""
    axis: Annotated[int, Field(ge=1, le=AXES)] | None = None
    """Axis of the board that moves it: 1, 2, 3 for X, Y, Z. Heads on one axis are of one carriage, which travels by the
    first of them. Default: the axis of the head's own number."""
    lasers: Annotated[tuple[RigLaser, ...], Field(min_length=1, max_length=MOST_LASERS)] = (RigLaser(),)
    """Its laser planes, numbered from 1. Lasers that light one plane from two sides count as one."""


PerAxis = Annotated[tuple[Positive, Positive, Positive], Field()]
"""One value for each of the axes X, Y, Z of the board."""


class RigBoard(Document):
    """The mechanics that the controller drives; a board with other settings is refused."""

    steps_per_mm: PerAxis = (80.0, 80.0, 80.0)
    """Belt with 2 mm teeth, pulley with 20, 1/16 steps of 1.8 degrees: 3200 / 40."""
    max_mm_per_s: PerAxis = (100.0, 100.0, 100.0)
    """Highest speed of each head; 36.4 mm/s take 40 cm in 11 s."""
    mm_per_s2: PerAxis = (500.0, 500.0, 500.0)
    """Acceleration."""
    travel_mm: PerAxis = (430.0, 430.0, 430.0)
    """Longest way of a head from its home switch: less than the distance of the two switches."""
    homing_mm_per_s: Positive = 40.0
    homing_slow_mm_per_s: Positive = 2.0
    """Speed at which the switch is approached for the second time, which gives the position."""
    pull_off_mm: Positive = 2.0
    """Distance of a head from its home switch after homing."""
    full_power: Positive = 1000.0
    """S at which the laser is at full power."""


class RigLatency(Document):
    """How much later a camera's times are than the controller's; measured with an object in both directions."""

    seconds: Annotated[float, Field(ge=-1, le=5)]
    sd_s: Annotated[float, Field(ge=0, le=1)]
    exposure_share: Share = 0.0
    """Of a frame's delay against the camera's even clock, the part that belongs to its exposure and not to delivery."""
    frame_sd_s: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Standard deviation of a frame's time besides."""
    exposure_ms: Milliseconds | None = None
    """Exposure with which it was measured."""


class RigCamera(Document):
    """One camera."""

    id: CameraId
    device: Annotated[str, Field(min_length=1, max_length=1000)]
    """A stable name (/dev/v4l/by-id/..., /dev/v4l/by-path/...) or a URL."""
    head: HeadNumber | None = None
    """The head that it is mounted on; default for cameras 1 to 8: the usual one of its number."""
    stands: Stands | None = None
    """Sides of the foot on which it stands, as in capture.yaml; default for cameras 1 to 8: those of its number."""
    lasers: Annotated[list[LaserNumber], Field(min_length=1)] | None = None
    """Numbers of the lasers of its head that it sees; default: all."""
    control_url: Annotated[str, Field(min_length=1, max_length=1000)] | None = None
    """Where a network camera takes exposure and gain."""
    latency: RigLatency | None = None
    """None until it was measured: a scan then says that its X is not to be relied on."""

    @model_validator(mode="after")
    def _has_head(self) -> Self:
        if self.head is None and self.id not in USUAL_HEADS:
            raise ValueError(f"camera {self.id} names no head, expected one: cameras 1 to 8 alone have a usual head")
        return self

    @property
    def on_head(self) -> int:
        """The head it stands on."""
        return self.head if self.head is not None else USUAL_HEADS[self.id]


class RigTravel(Document):
    """The travel of a scan; 40 cm in 11 s where nothing is said."""

    start_mm: Millimetres = 0.0
    length_mm: Annotated[float, Field(gt=0, le=2000)] = 400.0
    mm_per_s: Annotated[float, Field(gt=0, le=200)] = 400.0 / 11.0

    @property
    def end_mm(self) -> float:
        """X at which it ends."""
        return self.start_mm + self.length_mm


class RigLight(Document):
    """Within what the light may be set."""

    shortest_ms: Milliseconds = 0.3
    longest_ms: Milliseconds = 20.0
    """Motion during an exposure smears the stripe."""
    weakest: Share = 0.1
    """Share of their power below which the lasers do not shine evenly."""
    gain: Share = 0.0
    """Of each camera's range; gain makes noise grow with the picture."""
    white_balance_k: Annotated[float, Field(ge=1000, le=20000)] = 4600.0
    mains_hz: Annotated[int, _one_of(0, 50, 60)] = 50
    """Of the lamps."""

    @model_validator(mode="after")
    def _shortest_is_shorter(self) -> Self:
        if self.shortest_ms > self.longest_ms:
            raise ValueError(
                f"shortest_ms: expected at most longest_ms, {self.longest_ms:g}, found {self.shortest_ms:g}"
            )
        return self


def _each_once(cameras: list[RigCamera]) -> list[RigCamera]:
    for field in ("id", "device"):
        values = [getattr(camera, field) for camera in cameras]
        for value in values:
            if values.count(value) > 1:
                raise ValueError(f"{field} {value} is listed twice, expected each once")
    return cameras


class Rig(Document):
    """The content of rig.yaml."""

    format: Literal["footscan.rig/1"]
    scanner: Pseudonym
    """Its name: scans and calibrations bear it."""
    port: Port
    """Serial port of the board, best a stable name: /dev/serial/by-id/..."""
    heads: Annotated[tuple[RigHead, ...], Field(min_length=1, max_length=MOST_HEADS)] = (
        RigHead(),
        RigHead(),
        RigHead(),
    )
    """Numbered from 1. Default: head 1 above on the +Y side, head 2 above on the -Y side, head 3 below, each on
    the axis of its number."""
    board: RigBoard = RigBoard()
    cameras: Annotated[list[RigCamera], Field(min_length=1, max_length=MOST_CAMERAS), AfterValidator(_each_once)]
    travel: RigTravel = RigTravel()
    frames_per_second: Annotated[float, Field(gt=0, le=240)] = 200.0 / 11.0
    """Of each camera: 200 frames in 11 s."""
    light: RigLight = RigLight()
    calibration: RelativePath | None = None
    """The scanner's calibration, for scans that are reconstructed at once."""

    @model_validator(mode="after")
    def _heads_have_axes(self) -> Self:
        directions: dict[int, tuple[int, int]] = {}
        for number in range(1, len(self.heads) + 1):
            axis, direction = self.axis_of(number), self.heads[number - 1].direction
            if axis > AXES:
                raise ValueError(f"heads.{number - 1}: names no axis, expected 1 to {AXES}: the board has no more")
            first, of_first = directions.setdefault(axis, (number, direction))
            if direction != of_first:
                problem = f"expected {of_first}, the direction of head {first} on the same axis, found {direction}"
                raise ValueError(f"heads.{number - 1}.direction: {problem}")
        return self

    @model_validator(mode="after")
    def _cameras_have_heads(self) -> Self:
        for place, camera in enumerate(self.cameras):
            if camera.on_head > len(self.heads):
                problem = f"camera {camera.id} is on head {camera.on_head}, expected one of {len(self.heads)}"
                raise ValueError(f"cameras.{place}.head: {problem}")
            lasers, seen = len(self.heads[camera.on_head - 1].lasers), max(camera.lasers or [1])
            if seen > lasers:
                problem = f"camera {camera.id} sees laser {seen}, expected one of {lasers} of head {camera.on_head}"
                raise ValueError(f"cameras.{place}.lasers: {problem}")
        return self

    def axis_of(self, head: int) -> int:
        """The axis of the board that moves a head."""
        axis = self.heads[head - 1].axis
        return head if axis is None else axis

    def lasers_of(self, camera: RigCamera) -> dict[int, float]:
        """The lasers that a camera sees: number -> X of the plane minus X of the head, mm."""
        lasers = self.heads[camera.on_head - 1].lasers
        seen = camera.lasers or range(1, len(lasers) + 1)
        return {number: lasers[number - 1].offset_mm for number in sorted(set(seen))}
