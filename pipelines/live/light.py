"""The light of a scan: laser power and each camera's exposure, given by hand or chosen by what the cameras see."""

import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from footscan.capture.board.heads import Heads
from footscan.capture.cameras.deck import CameraDeck
from footscan.capture.cameras.stream import CapturedFrame
from footscan.capture.cameras.video_controls import ControlValues, FixedControl, controls_of
from footscan.capture.laser_light import LightLimits, choose_light
from footscan.frames.image import Rgb, decode_image
from schemas.base.errors import Fault
from schemas.rig import Rig

MAINS: dict[int, Literal[0, 50, 60]] = {0: 0, 50: 50, 60: 60}
TEST_PLACES = 3
"""Of the heads, along the travel, at which the light is looked at."""
FRAMES_A_PLACE = 2
SETTLE_SECONDS = 0.4
"""From a new exposure, or light, to the first frame that has it."""
LOOK_SECONDS = 2.0
"""How long the lasers shine on standing heads for a look."""


@dataclass(frozen=True)
class ScanLight:
    """The light of a scan."""

    power: float = 1.0
    """Of the lasers, 0 to 1."""
    exposure_ms: Mapping[int, float] = field(default_factory=dict)
    """Of each camera; one that is not named stays as it is."""
    reasons: Mapping[int, str] = field(default_factory=dict)
    looks: int = 0
    is_measured: bool = False


def light_by_hand(rig: Rig, power: float, exposure_ms: float) -> ScanLight:
    """The same exposure for all cameras."""
    return ScanLight(power, dict.fromkeys((camera.id for camera in rig.cameras), exposure_ms))


def fix_light(rig: Rig, deck: CameraDeck, exposure_ms: Mapping[int, float]) -> dict[int, list[FixedControl]]:
    """Fixes exposure, gain, white balance and mains frequency of the open cameras; what each made of it."""
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


def measured_light(rig: Rig, deck: CameraDeck, heads: Heads, check: Callable[[], None]) -> ScanLight:
    """The light in which the open cameras see the stripe best, with the heads at some places along the travel.

    `check` is called before each look; what it raises ends it.

    Raises
    ------
    Finding
        A camera does not see the stripe, or the room is too bright for it.
    Fault
        A device failed.
    """
    length = rig.travel.length_mm
    places = [rig.travel.start_mm + length * (k + 1) / (TEST_PLACES + 1) for k in range(TEST_PLACES)]

    def look(power: float, exposures: Mapping[int, float]) -> dict[int, Sequence[Rgb]]:
        fix_light(rig, deck, exposures)
        frames: dict[int, list[Rgb]] = defaultdict(list)
        for place in places:
            check()
            heads.travel_to(place)
            check()
            for camera, pictures in _look(deck, heads, power).items():
                frames[camera] += pictures
        return dict(frames)

    limits = LightLimits(shortest_ms=rig.light.shortest_ms, longest_ms=rig.light.longest_ms, weakest=rig.light.weakest)
    chosen = choose_light(deck.open_cameras, look, limits)
    return ScanLight(chosen.power, chosen.exposure_ms, chosen.reasons, chosen.looks, is_measured=True)


def _look(deck: CameraDeck, heads: Heads, power: float) -> dict[int, list[Rgb]]:
    """Some frames of each open camera, with the lasers at a power on heads that stand."""
    begin = time.monotonic()
    came: dict[int, list[bytes]] = {camera: [] for camera in deck.open_cameras}

    def keep(frame: CapturedFrame) -> None:
        since = frame.seconds - begin
        if frame.problem is None and SETTLE_SECONDS < since < LOOK_SECONDS - SETTLE_SECONDS:
            came[frame.camera] = [*came[frame.camera], frame.jpeg][-FRAMES_A_PLACE:]

    deck.send_to(keep)
    try:
        if power:
            heads.shine(power, LOOK_SECONDS)
        else:
            deck.wait_beyond(begin + LOOK_SECONDS, 3 * LOOK_SECONDS)
    finally:
        deck.send_to(None)
    for camera, frames in came.items():
        if not frames:
            raise Fault(f"camera {camera}: no frame within {LOOK_SECONDS:g} s")
    return {camera: [decode_image(jpeg) for jpeg in frames] for camera, frames in came.items()}
