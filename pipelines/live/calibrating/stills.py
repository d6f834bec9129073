"""Frames of standing heads with the lasers on, over an object that stands on the glass."""

from collections.abc import Mapping
from dataclasses import dataclass

from pipelines.live.devices import passes_of
from pipelines.live.light import ScanLight, fix_light, standing_frames
from pipelines.live.scanner import LiveScanner
from schemas.rig import Rig

LIT_SECONDS = 3.0
"""Time for which the lasers shine."""
SETTLE_SECONDS = 1.2
"""Time from then to the first frame that is used: a busy host or hub delivers frames late. Chosen by hand."""


@dataclass(frozen=True)
class Stills:
    """What the cameras saw while the heads stood."""

    frames: Mapping[int, tuple[bytes, bytes]]
    """Two JPEGs of each camera, the second one taken about a second after the first."""
    light: ScanLight
    problems: Mapping[int, str]
    """Why a camera gave no frame."""


def live_stills(scanner: LiveScanner, light: ScanLight | None) -> Stills:
    """Film what stands at `still_x_mm` with all cameras; without a light, choose one first."""
    x_mm = still_x_mm(scanner.rig)
    frames: dict[int, tuple[bytes, bytes]] = {}
    problems: dict[int, str] = {}
    with scanner.ready("the reference object"):
        passes = passes_of(scanner.rig, [camera.id for camera in scanner.rig.cameras])
        if light is None:
            light = scanner.measured_light(passes, [x_mm])
        for planned in passes:
            problems |= scanner.deck.open_only(planned.cameras)
            fix_light(scanner.rig, scanner.deck, light.exposure_ms)
            scanner.heads.travel_to(x_mm)
            taken = standing_frames(scanner.deck, scanner.heads, light.power, LIT_SECONDS, SETTLE_SECONDS)
            for camera, jpegs in taken.items():
                if jpegs:
                    frames[camera] = jpegs[0], jpegs[-1]
                else:
                    problems.setdefault(camera, f"camera {camera}: no frame while the lasers were on")
    return Stills(frames, light, problems)


def still_x_mm(rig: Rig) -> float:
    """X at which the heads stand: the middle of the travel."""
    return rig.travel.start_mm + rig.travel.length_mm / 2.0
