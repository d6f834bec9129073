"""The warnings of a scan: all that a reader must know before trusting its measures, each with what to do about it.

The quality step collects them once. Terminal, report, console and the table of results show that list.
"""

from collections import Counter
from collections.abc import Iterator

from footscan.report.markup import number, words
from footscan.report.quality_lights import AGREE_MM, FILLED_SHARES, LOST_SHARE, apart_mm
from schemas.measures import Measures
from schemas.quality import Quality
from schemas.recording import RecordedCamera, Recording

MOST_MEASURES = 4
"""Most measures that are named one by one; chosen by hand."""


def scan_warnings(measures: Measures, quality: Quality, recording: Recording | None = None) -> list[str]:
    """Collect the warnings, the gravest first; empty for a scan that nothing speaks against.

    `recording` : how the scan was filmed; None if unknown
    """
    filmed = {} if recording is None else {camera.id: camera for camera in recording.cameras}
    return [
        *_finding(measures),
        *_doubts(measures, quality),
        *_cameras(quality, filmed),
        *([] if recording is None else map(_sentence, recording.warnings)),
        *_latencies(filmed),
        *_agreement(quality),
        *_surface(quality),
        *(
            _sentence(warning)
            for warning in (*quality.warnings, *quality.heads.warnings, *quality.fusion.warnings)
            if warning not in measures.doubts
        ),
        *_not_taken(measures),
        *_uncertain(measures),
    ]


def warnings_of(measures: Measures, quality: Quality) -> list[str]:
    """The warnings that quality.json holds; collected anew for a file of an earlier version."""
    return scan_warnings(measures, quality) if quality.scan_warnings is None else quality.scan_warnings


def _sentence(phrase: str) -> str:
    """Begin with a capital letter, and end with a full stop.

    >>> _sentence("camera 3 is left out")
    'Camera 3 is left out.'
    """
    return f"{phrase[:1].upper()}{phrase[1:]}" + ("" if phrase.endswith((".", "?", "!")) else ".")


def _finding(measures: Measures) -> Iterator[str]:
    if measures.finding is not None:
        yield f"Nothing was measured ({measures.finding}). Is a bare foot flat on the glass, toes forward? Scan again."
    if measures.side_note is not None:
        yield f"{_sentence(measures.side_note)[:-1]}: was the right side chosen? Scan again if not."
    for thing in measures.things:
        yield f"{_sentence(thing)} All measures are uncertain. Take everything away from the foot, and scan again."


def _doubts(measures: Measures, quality: Quality) -> Iterator[str]:
    """The reasons for which all measures are uncertain."""
    check, heads = quality.calibration_check, quality.heads.doubt
    remedies: dict[str, str] = {}
    if heads is not None and quality.movement.first_moments:
        # A foot that has moved from one pass to the next looks like a head that is elsewhere.
        remedies[heads] = "If the foot moved between the passes, scan again first."
    elif heads is not None:
        remedies[heads] = "" if "scan again" in heads else "Then scan again."
    if check is not None and check.doubt is not None:
        again = "'footscan calibrate capture', then scan again" if check.drifted else "'footscan calibrate check' again"
        remedies[check.doubt] = f"Put the reference object onto the glass and run {again}."
    for doubt in dict.fromkeys([*remedies, *measures.doubts]):
        yield f"{_sentence(doubt)} All measures are uncertain. {remedies.get(doubt, '')}".rstrip()


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
        longest = f", the largest {number(mesh.largest_hole_mm)} mm around" if mesh.largest_hole_mm else ""
        yield (
            f"The surface is open ({mesh.holes} holes{longest}): see that no camera is left out or covered, then scan "
            "again."
        )
    elif mesh.filled_share is not None and mesh.filled_share > FILLED_SHARES[1]:
        sparsest = min(quality.cameras, key=lambda camera: camera.points, default=None)
        fewest = "" if sparsest is None else f" Camera {sparsest.camera} gave the fewest points."
        yield (
            f"{number(100 * mesh.filled_share)} % of the surface was seen by no camera.{fewest} Is cloth, a strap or "
            "the other foot in the way? Then scan again."
        )


def _not_taken(measures: Measures) -> Iterator[str]:
    missing = {name: m.note for name, m in measures.measures.items() if m.status == "incomplete"}
    if measures.finding is None and missing:
        yield f"Not taken: {_named(missing)}. Is the leg bare above the ankle, the foot in the middle? Then scan again."


def _uncertain(measures: Measures) -> Iterator[str]:
    """The measures that are uncertain for reasons of their own."""
    in_common = bool(measures.doubts or measures.things)
    own = {n: measures.own_note(n) for n, m in measures.measures.items() if m.status == "uncertain"}
    uncertain = {name: note for name, note in own.items() if note or not in_common}
    if uncertain:
        todo = (
            "Do not rely on them alone: the report shows what errs most. Mend that and scan again, or set a landmark "
            "that a note names by hand (footscan edit)."
        )
        yield f"Uncertain: {_named(uncertain)}. {todo}"


def _named(notes: dict[str, str | None]) -> str:
    """The first names of measures, those of one reason together with it, and how many there are more."""
    alike: dict[str, list[str]] = {}
    for name in list(notes)[:MOST_MEASURES]:
        alike.setdefault(notes[name] or "", []).append(words(name))
    more = f" and {len(notes) - MOST_MEASURES} more" if len(notes) > MOST_MEASURES else ""
    if len(alike) == 1:
        [(reason, names)] = alike.items()
        return f"{', '.join(names)}{more}" + (f": {reason}" if reason else "")
    parts = [", ".join(names) + (f" ({reason})" if reason else "") for reason, names in alike.items()]
    return f"{'; '.join(parts)}{more}"
