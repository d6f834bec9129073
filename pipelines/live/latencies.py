"""Latency of each camera, measured by passes over an object that stands still on the glass."""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from footscan.capture.film_frames import is_on_time, motion_of_head
from footscan.capture.latency import Latency, estimate_latency
from footscan.capture.latency import Pass as LatencyPass
from footscan.capture.passes import FilmedPass, PassPlan, film_name
from footscan.capture.recording import ScanRecording
from footscan.frames.array import chunk_name
from footscan.frames.image_files import ImageFiles
from footscan.frames.reader import pixel_frames
from footscan.stripe.film import extract_film
from footscan.stripe.laser import adapted
from pipelines.live.devices import passes_of
from pipelines.live.light import ScanLight
from pipelines.live.scanner import LiveScanner
from schemas.base.errors import Finding
from schemas.base.image_size import FRAME_SIZE
from schemas.frames import GROUP
from schemas.parameters.extraction import ExtractionParameters
from schemas.rig import Rig, RigLatency

FASTER = (1.5, 2.4)
"""Speeds of the passes relative to a scan; chosen by hand.

The offset by a latency is proportional to the speed: two speeds separate it from the play of the drive."""
LATEST_SECONDS = 0.5
"""Upper bound of the latency of a camera; chosen by hand."""
FASTEST_SHARE = 0.9
"""Largest speed of a pass as a share of the largest speed of the heads; chosen by hand."""


@dataclass(frozen=True)
class MeasuredLatencies:
    """Result of the passes."""

    latencies: dict[int, Latency]
    problems: dict[int, str]
    """Why the latency of a camera could not be measured."""


def measure_latencies(
    scanner: LiveScanner, from_mm: float, to_mm: float, light: ScanLight, on_progress: Callable[[int, int], None]
) -> MeasuredLatencies:
    """Film the object between two positions, forth and back at two speeds, and estimate the latency of each camera.

    `from_mm`, `to_mm` : X of the heads

    Raises
    ------
    Fault, RefusedInput
        As `LiveScanner.scan`.
    """
    rig = scanner.rig
    fastest = FASTEST_SHARE * min(rig.board.max_mm_per_s)
    plans = [
        PassPlan(*ends, min(factor * rig.travel.mm_per_s, fastest), light.power)
        for factor in FASTER
        for ends in ((from_mm, to_mm), (to_mm, from_mm))
    ]
    passes: dict[int, list[LatencyPass]] = {camera.id: [] for camera in rig.cameras}
    problems: dict[int, str] = {}
    groups = passes_of(rig, list(passes))
    count = len(groups) * len(plans)
    with scanner.ready_to_film(), tempfile.TemporaryDirectory(prefix="footscan-latency-") as folder:
        for number, (group, plan) in enumerate((group, plan) for group in groups for plan in plans):
            with ScanRecording(Path(folder) / "P" / f"pass-{number}", 0) as recording:
                filmed = scanner.film_one_pass(group, plan, light, recording, f"pass {number + 1} of {count}")
                recording.settle()
                problems |= filmed.failed
                for camera in (camera for camera in rig.cameras if camera.id in group.cameras):
                    passes[camera.id].append(_observed(scanner, filmed, camera.id, camera.on_head, recording))
            on_progress(number + 1, count)
    latencies: dict[int, Latency] = {}
    for camera_id, of_camera in passes.items():
        if camera_id in problems:
            continue
        try:
            latencies[camera_id] = estimate_latency(camera_id, of_camera)
        except Finding as finding:
            problems[camera_id] = str(finding)
    return MeasuredLatencies(latencies, problems)


def rig_with(rig: Rig, latencies: Mapping[int, Latency], light: ScanLight) -> Rig:
    """The rig with the latencies that were measured in a light."""
    cameras = [
        camera.model_copy(update={"latency": _document(latencies[camera.id], light.exposure_ms.get(camera.id))})
        if camera.id in latencies
        else camera
        for camera in rig.cameras
    ]
    return rig.model_copy(update={"cameras": cameras})


def _document(latency: Latency, exposure_ms: float | None) -> RigLatency:
    return RigLatency(
        seconds=round(latency.seconds, 6),
        sd_s=round(latency.sd_s, 6),
        exposure_share=round(latency.exposure_share, 4),
        frame_sd_s=round(latency.frame_sd_s, 6),
        exposure_ms=exposure_ms,
    )


def _observed(
    scanner: LiveScanner, filmed: FilmedPass, camera: int, head: int, recording: ScanRecording
) -> LatencyPass:
    """The stripe in the frames of a camera on a pass, with their times."""
    first, clock = filmed.times[camera]
    tally = filmed.films[film_name(camera)]
    begin, end = filmed.travel
    usable = is_on_time(clock) & (clock.seconds >= begin) & (clock.seconds <= end + LATEST_SECONDS)
    arrivals = [
        arrival
        for arrival in sorted(tally.taken - tally.problems.keys())
        if 0 <= arrival - first < len(usable) and usable[arrival - first]
    ]
    array = recording.file(GROUP) / film_name(camera)
    film = ImageFiles(array, [array / chunk_name(arrival) for arrival in arrivals], FRAME_SIZE)
    stripe = extract_film(pixel_frames(film), adapted(film, ExtractionParameters()))
    rows = np.array(arrivals, np.int64) - first
    motion = motion_of_head(scanner.heads.log, head, filmed.travel)
    return LatencyPass(stripe, clock.seconds[rows], clock.delay_s[rows], motion)
