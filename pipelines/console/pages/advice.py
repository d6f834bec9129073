"""Advice on a scan of poor quality: the camera, the reason, and what to do."""

from collections import Counter
from collections.abc import Iterator

from footscan.report.markup import number, words
from footscan.report.quality_lights import AGREE_MM, FILLED_SHARES, LOST_SHARE, apart_mm
from schemas.measures import Measures
from schemas.quality import Quality
from schemas.recording import RecordedCamera, Recording

MOST_MEASURES = 4
"""Most measures that are named one by one; chosen by hand."""


def advice(measures: Measures, quality: Quality, recording: Recording | None) -> list[str]:
    """List the problems that a second scan or a repair may solve, a line each, the gravest first.

    `recording` : how the scan was filmed; None if unknown
    """
    filmed = {} if recording is None else {camera.id: camera for camera in recording.cameras}
    return [
        *_finding(measures),
        *_heads(quality),
        *_calibration(quality),
        *_cameras(quality, filmed),
        *_latencies(filmed),
        *_agreement(quality),
        *_surface(quality),
        *_not_taken(measures),
        *([] if recording is None else recording.warnings),
    ]


def _finding(measures: Measures) -> Iterator[str]:
    if measures.finding is not None:
        yield f"Nothing was measured ({measures.finding}). Is a bare foot flat on the glass, toes forward? Scan again."
    if measures.side_note is not None:
        yield f"{measures.side_note[:1].upper()}{measures.side_note[1:]}: was the right side chosen? Scan again if not."
    for thing in measures.things:
        yield f"{thing[:1].upper()}{thing[1:]}. Take everything away from the foot, and scan again."


def _heads(quality: Quality) -> Iterator[str]:
    if quality.heads.doubt is not None:
        yield f"{quality.heads.doubt[:1].upper()}{quality.heads.doubt[1:]}. Then scan again."


def _calibration(quality: Quality) -> Iterator[str]:
    check = quality.calibration_check
    if check is None or check.doubt is None:
        return
    again = "'footscan calibrate capture', then scan again" if check.drifted else "'footscan calibrate check' again"
    yield f"{check.doubt[:1].upper()}{check.doubt[1:]}. Put the reference object onto the glass and run {again}."


def _cameras(quality: Quality, filmed: dict[int, RecordedCamera]) -> Iterator[str]:
    for camera in quality.cameras:
        name = f"Camera {camera.camera}"
        if not camera.points:
            yield (
                f"{name} saw no stripe in {camera.frames} frames. Look at its live picture with “Show the stripe”: is "
                "the lens covered or dirty, is its laser on, is the room too bright? Then scan again."
            )
        elif camera.frames_lost > LOST_SHARE * camera.frames:
            lost = f"{name} lost {camera.frames_lost} of {camera.frames} frames{_reason(filmed.get(camera.camera))}."
            yield f"{lost} Check its cable and its hub, or give it a port of its own. Then scan again."


def _reason(camera: RecordedCamera | None) -> str:
    """The most frequent reason of the lost frames of a camera."""
    reasons = Counter(frame.reason for frame in camera.lost).most_common(1) if camera else []
    return "".join(f", {count} of them: {reason}" for reason, count in reasons)


def _latencies(filmed: dict[int, RecordedCamera]) -> Iterator[str]:
    unknown = [str(camera_id) for camera_id, camera in sorted(filmed.items()) if camera.latency is None]
    if unknown:
        plural = "s" if len(unknown) > 1 else ""
        yield (
            f"The latency of camera{plural} {', '.join(unknown)} was never measured, so lengths along the foot may be "
            "off: run 'footscan calibrate latency'."
        )


def _agreement(quality: Quality) -> Iterator[str]:
    apart = {camera: mm for camera, mm in apart_mm(quality).items() if mm > AGREE_MM[1]}
    if not apart:
        return
    suspect = max(apart, key=lambda camera: apart[camera])
    yield (
        f"Camera {suspect} sees the skin {number(apart[suspect], 2)} mm from where the others see it. If the foot "
        "moved, scan again; if the error stays, the camera was moved: check it with 'footscan calibrate check'."
    )


def _surface(quality: Quality) -> Iterator[str]:
    mesh = quality.mesh
    if mesh.holes:
        yield f"The surface is open ({mesh.holes} holes). Scan again."
    elif mesh.filled_share is not None and mesh.filled_share > FILLED_SHARES[1]:
        sparsest = min(quality.cameras, key=lambda camera: camera.points, default=None)
        fewest = "" if sparsest is None else f" Camera {sparsest.camera} gave the fewest points."
        yield (
            f"{number(100 * mesh.filled_share)} % of the surface was seen by no camera.{fewest} Is cloth, a strap or "
            "the other foot in the way? Then scan again."
        )


def _not_taken(measures: Measures) -> Iterator[str]:
    missing = {name: m.note for name, m in measures.measures.items() if m.status == "incomplete"}
    if measures.finding is not None or not missing:
        return
    reasons = sorted({note for note in missing.values() if note})
    named = ", ".join(words(name) for name in list(missing)[:MOST_MEASURES])
    more = f" and {len(missing) - MOST_MEASURES} more" if len(missing) > MOST_MEASURES else ""
    why = f": {'; '.join(reasons[:MOST_MEASURES])}" if reasons else ""
    yield f"Not taken: {named}{more}{why}. Is the leg bare above the ankle, the foot in the middle? Then scan again."
