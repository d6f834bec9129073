"""What to do about a scan that is not good: which camera, and why."""

from collections import Counter
from collections.abc import Iterator

from footscan.report.markup import number, words
from footscan.report.quality_lights import AGREE_MM, FILLED_SHARES, LOST_SHARE, apart_mm
from schemas.measures import Measures
from schemas.quality import Quality
from schemas.recording import RecordedCamera, Recording

MOST_MEASURES = 4
"""Named one by one; more have one reason."""


def advice(measures: Measures, quality: Quality, recording: Recording | None) -> list[str]:
    """A line for each thing that a second try, or somebody with a screwdriver, may mend; the gravest first.

    `recording` tells how the scan was filmed; None of scans of which that is not known.
    """
    filmed = {} if recording is None else {camera.id: camera for camera in recording.cameras}
    return [
        *_finding(measures),
        *_cameras(quality, filmed),
        *_places(filmed),
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
    """Why most of its frames were lost."""
    reasons = Counter(one.reason for one in camera.lost).most_common(1) if camera else []
    return "".join(f", {count} of them: {reason}" for reason, count in reasons)


def _places(filmed: dict[int, RecordedCamera]) -> Iterator[str]:
    unknown = [str(camera) for camera, one in sorted(filmed.items()) if one.latency is None]
    if unknown:
        several = "s" if len(unknown) > 1 else ""
        yield (
            f"How late the pictures of camera{several} {', '.join(unknown)} come was never measured, so lengths along "
            "the foot may be off: run 'footscan calibrate latency'."
        )


def _agreement(quality: Quality) -> Iterator[str]:
    apart = {camera: mm for camera, mm in apart_mm(quality).items() if mm > AGREE_MM[1]}
    if not apart:
        return
    suspect = max(apart, key=lambda camera: apart[camera])
    yield (
        f"Camera {suspect} sees the skin {number(apart[suspect], 2)} mm from where the others see it. If the foot "
        "moved, scan again; if it stays so, the camera was knocked: check it with 'footscan calibrate check'."
    )


def _surface(quality: Quality) -> Iterator[str]:
    mesh = quality.mesh
    if mesh.holes:
        yield f"The surface is open ({mesh.holes} holes). Scan again."
    elif mesh.filled_share is not None and mesh.filled_share > FILLED_SHARES[1]:
        few = min(quality.cameras, key=lambda camera: camera.points, default=None)
        least = "" if few is None else f" Camera {few.camera} gave the fewest points."
        yield (
            f"{number(100 * mesh.filled_share)} % of the surface was seen by no camera.{least} Is cloth, a strap or "
            "the other foot in the way? Then scan again."
        )


def _not_taken(measures: Measures) -> Iterator[str]:
    missing = {name: one.note for name, one in measures.measures.items() if one.status == "incomplete"}
    if measures.finding is not None or not missing:
        return
    reasons = sorted({note for note in missing.values() if note})
    named = ", ".join(words(name) for name in list(missing)[:MOST_MEASURES])
    more = f" and {len(missing) - MOST_MEASURES} more" if len(missing) > MOST_MEASURES else ""
    why = f": {'; '.join(reasons[:MOST_MEASURES])}" if reasons else ""
    yield f"Not taken: {named}{more}{why}. Is the leg bare above the ankle, the foot in the middle? Then scan again."
