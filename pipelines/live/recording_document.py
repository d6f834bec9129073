"""The document recording.json: how a scan was filmed."""

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from footscan.capture.board.heads import Heads
from footscan.capture.cameras.usb_bus import Pass
from footscan.capture.cameras.video_controls import FixedControl
from footscan.capture.film_frames import CameraTiming, FilmFrames
from footscan.capture.passes import FilmedPass, PassPlan
from pipelines.engine.files.digest import sha256
from pipelines.live.devices import timing_of
from pipelines.live.light import ScanLight
from pipelines.version import SOFTWARE
from schemas.base.model import canonical_json
from schemas.calibration_check import CalibrationCheck
from schemas.recording import LeftOut, RecordedBoard, RecordedCamera, RecordedLight, RecordedPass, Recording
from schemas.rig import Rig, RigCamera

LONGEST_TEXT = 1000
"""Most characters of a warning, as in `schemas.recording.Text`."""


@dataclass
class ScanStory:
    """Data on the making of a scan that its documents need."""

    started: datetime.datetime
    light: ScanLight
    passes: Sequence[Pass]
    plan: PassPlan
    filmed: list[FilmedPass] = field(default_factory=list)
    """Filmed passes, in the order of `passes`."""
    fixed: dict[int, list[FixedControl]] = field(default_factory=dict)
    """Result of fixing the settings of each camera."""
    lost_steps_mm: tuple[float, ...] | None = None
    """Position errors of heads 1, 2, ... after the last travel, by their home switches."""
    calibration_check: CalibrationCheck | None = None
    """The last check of the scanner's calibration before the scan; None without one."""

    def timing(self, camera: RigCamera) -> CameraTiming:
        """Timing of a camera in the light of the scan."""
        return timing_of(camera, self.light.exposure_ms.get(camera.id))


def recording_document(
    rig: Rig, story: ScanStory, films: Mapping[int, FilmFrames], left_out: Mapping[int, str], heads: Heads
) -> Recording:
    """Build the document of a scan; `left_out` holds the cameras that are not in it, and why."""
    settings = {str(number): value for number, value in heads.board.settings().items()}
    travels = [heads.log.arrays(*filmed.travel) for filmed in story.filmed]
    times_sd = np.concatenate([sd for _, _, sd in travels])
    cameras = [_camera(camera, story, films[camera.id]) for camera in rig.cameras if camera.id in films]
    plan = story.plan
    return Recording(
        scanner=rig.scanner,
        started=story.started,
        software=SOFTWARE,
        board=RecordedBoard(
            port=rig.port,
            version=heads.board.version,
            settings_sha256=sha256(canonical_json(settings).encode()),
            reports=len(times_sd),
            report_sd_s=_rms(times_sd),
            lost_steps_mm=story.lost_steps_mm,
        ),
        light=RecordedLight(power=story.light.power, looks=story.light.looks, is_measured=story.light.is_measured),
        passes=[
            RecordedPass(
                cameras=list(filmed.cameras),
                reason=planned.reason,
                start_mm=plan.start_mm,
                end_mm=plan.end_mm,
                mm_per_s=plan.mm_per_s,
                seconds=filmed.travel.end_seconds - filmed.travel.begin_seconds,
            )
            for filmed, planned in zip(story.filmed, story.passes, strict=True)
        ],
        cameras=cameras,
        warnings=[
            f"camera {camera} is left out: {problem}"[:LONGEST_TEXT] for camera, problem in sorted(left_out.items())
        ],
    )


def _camera(camera: RigCamera, story: ScanStory, film: FilmFrames) -> RecordedCamera:
    clock = next(filmed.times[camera.id][1] for filmed in story.filmed if camera.id in filmed.cameras)
    fixed = {control.name: control for control in story.fixed.get(camera.id, [])}
    actual = {name: control.found for name, control in fixed.items()}
    return RecordedCamera(
        id=camera.id,
        device=camera.device,
        head=camera.on_head,
        exposure_ms=actual.get("exposure_ms"),
        gain=actual.get("gain"),
        light_reason=story.light.reasons.get(camera.id),
        not_fixed=[f"{name}: {control.problem}"[:LONGEST_TEXT] for name, control in fixed.items() if control.problem],
        expected=len(film.x_mm) + len(film.left_out),
        stored=len(film.arrivals),
        lost=[LeftOut(number=int(film.number[k]), reason=reason) for k, reason in film.lost.items()],
        left_out=[LeftOut(number=number, reason=reason) for number, reason in film.left_out.items()],
        latency=camera.latency,
        position_sd_mm=_rms(film.sd_mm),
        largest_position_sd_mm=float(film.sd_mm.max()),
        mm_per_s=film.mm_per_s,
        frames_per_second=1.0 / clock.period_s,
    )


def _rms(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0
