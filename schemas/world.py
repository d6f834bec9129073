"""A whole world of the virtual scanner: room, lasers, heads, cameras, glass and what stands on it.

A scalar is one quantity that a report can set against an error. Details that take many numbers, such as the places of
things in the room, follow from the world's seed.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from schemas.base.model import Document, Side
from schemas.parameters.simulation import Seed
from schemas.rig import MOST_CAMERAS
from schemas.scan import CameraId

Share = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=0, le=50)]
Positive = Annotated[float, Field(gt=0, le=1e4)]
NotNegative = Annotated[float, Field(ge=0, le=1e4)]
Signed = Annotated[float, Field(ge=-1e3, le=1e3)]
Kind = Literal["foot", "cast", "last"]
Covering = Literal["none", "white sock", "black sock", "patterned sock"]
Toe = Annotated[int, Field(ge=1, le=5)]


class WorldRoom(Document):
    """What the cameras see apart from the object and the stripe."""

    light: NotNegative = 0.0
    """Light of the room on a white surface that faces the lamps, in units of the sensor's white at gain 1."""
    warmth: Signed = 0.0
    """Colour of the lamps: red grows and blue falls by this share."""
    flicker: Share = 0.0
    """Share of the light that changes with the mains."""
    mains_hz: Annotated[int, Field(ge=50, le=60)] = 50
    """Lamps flicker at twice this frequency."""
    things: Count = 0
    """Things that stand still while the heads travel past them."""
    red_things: Count = 0
    line_things: Count = 0
    """Thin bright things, such as cables and edges of shelves."""
    sun_patches: Count = 0
    people: Count = 0
    """People who move in the background."""
    mirrors: Count = 0
    """Shiny things that show the stripe a second time."""
    head_glints: Count = 0
    """Red glints a camera that travel with its head."""
    room_glints: Count = 0
    """Red glints a camera that stand in the room."""
    stripe_glints: Count = 0
    """Red glints a camera that move as the stripe does."""


class WorldLaser(Document):
    """The laser sheets."""

    colour: Literal["red", "green", "blue"] = "red"
    power: Positive = 24.0
    """Light of the sheet on a matt white surface, in units of the sensor's white at gain 1."""
    sigma_mm: Positive = 0.32
    """Standard deviation of the sheet's Gaussian across X, at its focus."""
    bend_mm: Signed = 0.0
    """Sagitta of the sheet over 140 mm."""
    speckle: Share = 0.12
    lower_lasers: Annotated[int, Field(ge=1, le=2)] = 1
    lower_apart_mm: Annotated[float, Field(ge=0, le=100)] = 0.0
    """How far ahead of the first lower laser's plane that of the second one is, along X. At 0 both light one plane,
    from two sides."""


class WorldHead(Document):
    """How one head differs from the nominal one. The calibration is made with the same head."""

    offset_mm: Signed = 0.0
    """Its laser plane stands at X + offset."""
    yaw_deg: Signed = 0.0
    """About Z, Y (pitch) and X (roll); yaw and pitch tilt the laser plane against the travel."""
    pitch_deg: Signed = 0.0
    roll_deg: Signed = 0.0
    travel_scale: Signed = 0.0
    """The head travels 1 + this per millimetre that it reports."""
    speed: Positive = 1.0
    """Speed relative to the first head."""
    jitter_mm: NotNegative = 0.0
    """Standard deviation of X from frame to frame."""
    ripple_mm: NotNegative = 0.0
    """Amplitude of a periodic error of X."""
    ripple_period_mm: Positive = 40.0
    lost_mm: Signed = 0.0
    """Steps that the motor loses once in the travel."""
    lost_at: Share = 0.5
    """Where, as a share of the travel."""


class Knock(Document):
    """A camera that was moved after the calibration."""

    camera: CameraId
    mm: tuple[Signed, Signed, Signed]
    turn_deg: tuple[Signed, Signed, Signed]


class WorldRig(Document):
    """Other cameras than the standard eight: they stand at random about the foot, those above first."""

    above: Annotated[int, Field(ge=0, le=MOST_CAMERAS)] = 4
    """Those on the upper heads, on either side in turn."""
    below: Annotated[int, Field(ge=0, le=MOST_CAMERAS)] = 4

    @model_validator(mode="after")
    def _are_some(self) -> Self:
        if not 1 <= self.above + self.below <= MOST_CAMERAS:
            raise ValueError(f"expected 1 to {MOST_CAMERAS} cameras, found {self.above + self.below}")
        return self


class WorldCameras(Document):
    """All cameras."""

    size: Literal["640x480", "1280x720"] = "640x480"
    frames: Annotated[int, Field(ge=8, le=1000)] = 100
    step_mm: Annotated[float, Field(gt=0, le=50)] = 4.0
    """Travel from frame to frame."""
    frames_per_second: Positive = 18.0
    gain: Positive = 1.0
    """Brightness of the picture, exposure and amplifier together; noise of the sensor grows with it."""
    auto_exposure: bool = False
    auto_white_balance: bool = False
    gamma: Positive = 2.2
    noise: NotNegative = 1.0
    """1 is the sensor of a webcam."""
    blur_px: NotNegative = 0.7
    """Point spread of lens and pixel, standard deviation."""
    defocus_px: NotNegative = 0.0
    """Standard deviation that is added at the ends of the depth of field, 60 mm from the middle."""
    smudges: Count = 0
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 85
    jpeg_chroma: Literal["422", "420"] = "420"
    rolling_shutter_ms: NotNegative = 0.0
    """Time from the first row to the last."""
    missing: list[CameraId] = Field(default_factory=list)
    knocked: list[Knock] = Field(default_factory=list)
    corner_px: NotNegative = 0.05
    """Standard deviation with which the corners of the reference object are located for the calibration."""


class WorldGlass(Document):
    """The plate."""

    thickness_mm: Positive = 6.0
    tilt_x_deg: Signed = 0.0
    """Tilt about X and Y since the calibration."""
    tilt_y_deg: Signed = 0.0
    height_mm: Signed = 0.0
    """Height of its upper face since the calibration."""
    ghost: Share = 0.01
    """Strength of the inner reflection, as a share of the light that passes."""
    scratches: Count = 0
    dust: Count = 0
    fingerprints: Count = 0
    wet_spots: Count = 0


class Deformity(Document):
    """How a foot differs from the usual form."""

    ankle_swelling_mm: NotNegative = 0.0
    hammer_toes: Share = 0.0
    """0 is straight, 1 is a knuckle that rises by half of the toe's height."""
    missing_toes: list[Toe] = Field(default_factory=list)
    amputated_at: Share | None = None
    """Share of the length at which the forefoot ends."""


class WorldSubject(Document):
    """What stands on the glass."""

    kind: Kind = "foot"
    side: Side = "right"
    shape_seed: Seed = 1
    length_mm: Annotated[float, Field(ge=80, le=400)] = 262.0
    arch_mm: Positive = 13.5
    toe_gap_mm: Signed = 1.8
    """Between neighbouring toe pads; below 0 they are grown together."""
    deformity: Deformity = Deformity()
    leg_mm: Annotated[float, Field(ge=60, le=400)] = 108.0
    """Height at which the leg ends."""
    y_mm: Signed = 0.0
    """Place and turn on the glass."""
    turn_deg: Signed = 0.0
    covering: Covering = "none"
    albedo: Share = 0.6
    """Share of laser light that the surface scatters back."""
    scatter_mm: NotNegative = 1.0
    """Distance over which light spreads below the skin."""
    hairs: Count = 0
    nail_gloss: Share = 0.0
    tattoos: Count = 0
    tremor_mm: NotNegative = 0.0
    """Standard deviation of fast movement, 8 to 12 Hz."""
    sway_mm: NotNegative = 0.0
    """Amplitude of slow movement, 0.2 to 0.8 Hz."""
    shift_mm: tuple[Signed, Signed] = (0.0, 0.0)
    """X and Y by which the foot has moved before the pass of the lower head."""
    wait_s: NotNegative = 0.0
    """Time from the pass of the upper heads to that of the lower one; 0: all film at the same time."""


class World(Document):
    """The content of world.json."""

    format: Literal["footscan.world/1"] = "footscan.world/1"
    seed: Seed
    room: WorldRoom = WorldRoom()
    laser: WorldLaser = WorldLaser()
    heads: tuple[WorldHead, WorldHead, WorldHead] = (WorldHead(), WorldHead(), WorldHead())
    cameras: WorldCameras = WorldCameras()
    rig: WorldRig | None = None
    """None: the standard eight cameras."""
    glass: WorldGlass = WorldGlass()
    subject: WorldSubject = WorldSubject()
