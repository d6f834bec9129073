"""Light of a scan: laser power and exposure of each camera, set by hand or measured."""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from footscan import clock
from footscan.capture.board.heads import Heads
from footscan.capture.cameras.deck import CameraDeck
from footscan.capture.cameras.stream import CapturedFrame
from footscan.capture.cameras.video_controls import ControlValues, FixedControl, controls_of
from footscan.frames.image import Rgb, decode_image
from schemas.base.errors import Fault
from schemas.rig import Rig

MAINS: dict[int, Literal[0, 50, 60]] = {0: 0, 50: 50, 60: 60}
"""Mains frequencies, Hz, as the literal type that the camera controls take."""
TEST_PLACES = 3
"""Positions along the travel at which the light is measured; chosen by hand."""
FRAMES_A_PLACE = 2
"""Frames of each camera at such a position; chosen by hand."""
SETTLE_SECONDS = 0.4
"""Time from a new exposure or laser power to the first frame that has it; chosen by hand."""
LOOK_SECONDS = 2.0
"""Time that the lasers shine on standing heads for a measurement; chosen by hand."""


@dataclass(frozen=True)
class ScanLight:
    """The light of a scan."""

    power: float = 1.0
    """Power of the lasers, 0 to 1."""
    exposure_ms: Mapping[int, float] = field(default_factory=dict)
    """Exposure of each camera; a camera without an entry keeps its exposure."""
    reasons: Mapping[int, str] = field(default_factory=dict)
    """Reason of the exposure of each camera, if it was measured."""
    looks: int = 0
    """Number of measurements."""
    is_measured: bool = False


def light_by_hand(rig: Rig, power: float, exposure_ms: float) -> ScanLight:
    """A light with the same exposure for all cameras."""
    return ScanLight(power, dict.fromkeys((camera.id for camera in rig.cameras), exposure_ms))


def fix_light(rig: Rig, deck: CameraDeck, exposure_ms: Mapping[int, float]) -> dict[int, list[FixedControl]]:
    """Fix exposure, gain, white balance and mains frequency of the open cameras; returns the result by camera."""
    by_id = {camera.id: camera for camera in rig.cameras}
    fixed = {}
    for camera in deck.open_cameras:
        values = ControlValues(
            exposure_ms=exposure_ms.get(camera),
            gain=rig.light.gain,
            white_balance_k=rig.light.white_balance_k,
            mains_hz=MAINS[rig.light.mains_hz],
        )
        fixed[camera] = controls_of(deck.sources[camera], by_id[camera].control_url).fix(values)
    return fixed


def places_of_scan(rig: Rig) -> list[float]:
    """X, mm, of the positions along the travel at which the light of a scan is measured."""
    return [rig.travel.start_mm + rig.travel.length_mm * (k + 1) / (TEST_PLACES + 1) for k in range(TEST_PLACES)]


def measured_light(
    rig: Rig, deck: CameraDeck, heads: Heads, places: Sequence[float], check: Callable[[], None]
) -> ScanLight:
    """Measure the light in which the open cameras see the stripe best, with the heads at `places`, X in mm.

    `check` is called before each measurement and may raise an exception to end it.

    Raises
    ------
    Finding
        A camera does not see the stripe, or the room is too bright for it.
    Fault
        A device failed.
    """
    from footscan.capture.light_choice import LightLimits, choose_light

    def look(power: float, exposures: Mapping[int, float]) -> dict[int, Sequence[Rgb]]:
        fix_light(rig, deck, exposures)
        frames: dict[int, list[Rgb]] = defaultdict(list)
        for place in places:
            check()
            heads.travel_to(place)
            check()
            for camera, jpegs in standing_frames(deck, heads, power).items():
                if not jpegs:
                    raise Fault(f"camera {camera}: no frame within {LOOK_SECONDS:g} s")
                frames[camera] += [decode_image(jpeg) for jpeg in jpegs[-FRAMES_A_PLACE:]]
        return dict(frames)

    limits = LightLimits(shortest_ms=rig.light.shortest_ms, longest_ms=rig.light.longest_ms, weakest=rig.light.weakest)
    chosen = choose_light(deck.open_cameras, look, limits)
    return ScanLight(chosen.power, chosen.exposure_ms, chosen.reasons, chosen.looks, is_measured=True)


def light_of_all(passes: Sequence[ScanLight], longest_ms: float) -> ScanLight:
    """The measured light of all passes, with the weakest power of any: where it was stronger, cameras expose longer."""
    power = min(light.power for light in passes)
    exposures: dict[int, float] = {}
    reasons: dict[int, str] = {}
    for light in passes:
        reasons |= light.reasons
        for camera, exposure_ms in light.exposure_ms.items():
            exposures[camera] = min(exposure_ms * light.power / power, longest_ms)
    return ScanLight(power, exposures, reasons, sum(light.looks for light in passes), is_measured=True)


def standing_frames(
    deck: CameraDeck, heads: Heads, power: float, seconds: float = LOOK_SECONDS, settle_seconds: float = SETTLE_SECONDS
) -> dict[int, list[bytes]]:
    """Take the JPEGs of each open camera, with standing heads and the lasers at `power` for so many `seconds`.

    The frames of the first `settle_seconds` are left out, and of the last `SETTLE_SECONDS`. A camera that gave no frame
    has an empty list.
    """
    begin = clock.seconds()
    jpegs: dict[int, list[bytes]] = {camera: [] for camera in deck.open_cameras}

    def keep(frame: CapturedFrame) -> None:
        since = frame.seconds - begin
        if frame.problem is None and settle_seconds < since < seconds - SETTLE_SECONDS:
            jpegs[frame.camera].append(frame.jpeg)

    deck.send_to(keep)
    try:
        if power:
            heads.shine(power, seconds)
        else:
            deck.wait_beyond(begin + seconds, 3 * seconds)
    finally:
        deck.send_to(None)
    return jpegs
