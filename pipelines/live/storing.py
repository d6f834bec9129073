"""Storing of a filmed scan in the archive: films with positions, scan.yaml, recording.json, the calibration's check."""

import datetime
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple

from footscan.capture.board.heads import Heads
from footscan.capture.film_frames import (
    FilmFrames,
    motion_of_head,
    nearest_frames,
    place_frames,
    standing_frame,
)
from footscan.capture.frame_positions import write_positions
from footscan.capture.passes import FilmedPass, film_name
from footscan.capture.recording import ScanRecording
from footscan.recordings.scans import RECORDING_FILE
from pipelines.live.recording_document import ScanStory, recording_document
from schemas.base.errors import Finding, FootscanError, RefusedInput
from schemas.base.model import Posture, Side
from schemas.frames import GROUP
from schemas.rig import Rig, RigCamera
from schemas.scan import Scan

CHECK_FILE = "calibration.check.json"
"""Name of the check of the calibration in the folder of a scan."""
LARGEST_SD_MM = 0.3
"""Largest standard deviation of the position of a frame; a frame with a larger one is lost. Chosen by hand."""
FRAME_BYTES = 40_000
"""Expected size of a frame, for the check of the free space before a scan."""
MOST_SCANS = 999
"""Most scans of a day and side of a patient; chosen by hand."""


@dataclass(frozen=True)
class ScanName:
    """Patient, name, side, date and posture of a scan."""

    patient: str
    scan: str
    side: Side
    date: datetime.date
    posture: Posture = "unknown"


@dataclass(frozen=True)
class FilmedScan:
    """A stored scan."""

    place: Path
    films: dict[int, FilmFrames]
    """Frames of each camera of the scan."""
    left_out: dict[int, str] = field(default_factory=dict)
    """Cameras that are left out, and why."""


class StoredFilms(NamedTuple):
    """The films of a recording that has no name yet."""

    scan: Scan
    films: dict[int, FilmFrames]
    """As of `FilmedScan`."""
    left_out: dict[int, str]
    """As of `FilmedScan`."""


def store_scan(
    rig: Rig, name: ScanName, story: ScanStory, heads: Heads, recording: ScanRecording, keep_partial: bool
) -> FilmedScan:
    """`store_films`, then `name_scan`; errors as of both."""
    stored = store_films(rig, name, story, heads, recording, keep_partial)
    return name_scan(rig, story, heads, recording, stored)


def store_films(
    rig: Rig, name: ScanName, story: ScanStory, heads: Heads, recording: ScanRecording, keep_partial: bool
) -> StoredFilms:
    """Compute the positions of the frames, and complete the films.

    Raises
    ------
    Finding
        The film of a camera is incomplete and `keep_partial` is False; or no film is complete.
    Fault
        The disk refuses.
    """
    films: dict[int, FilmFrames] = {}
    left_out: dict[int, str] = {}
    entries = []
    for number, filmed in enumerate(story.filmed, start=1):
        for camera in (camera for camera in rig.cameras if camera.id in filmed.cameras):
            try:
                film = _placed(story, camera, filmed, heads)
            except FootscanError as error:
                left_out[camera.id] = str(error)
                continue
            if film.problem is not None:
                left_out[camera.id] = film.problem
                continue
            films[camera.id] = film
            entry = _store_camera(camera, film, filmed, heads, story, recording)
            entries.append(entry if number == 1 else {**entry, "pass_number": number})
    if left_out and (not keep_partial or not films):
        problems = "; ".join(f"camera {camera}: {problem}" for camera, problem in sorted(left_out.items()))
        raise Finding(f"the scan is incomplete: {problems}")
    for camera_id in left_out:
        for background in (False, True):
            recording.drop_film(film_name(camera_id, background=background))
    check = story.calibration_check
    if check is not None:
        recording.file(CHECK_FILE).write_text(check.model_dump_json(indent=2) + "\n", encoding="utf-8")
    scan = Scan.model_validate(
        {
            "format": "footscan.scan/1",
            "patient": name.patient,
            "scan": name.scan,
            "side": name.side,
            "date": name.date,
            "posture": name.posture,
            "scanner": rig.scanner,
            "calibration_check": None if check is None else CHECK_FILE,
            "cameras": sorted(entries, key=lambda entry: int(str(entry["id"]))),
        }
    )
    return StoredFilms(scan, films, left_out)


def name_scan(rig: Rig, story: ScanStory, heads: Heads, recording: ScanRecording, stored: StoredFilms) -> FilmedScan:
    """Write how the scan was filmed, and give it its name in the archive; Fault if the disk refuses."""
    document = recording_document(rig, story, stored.films, stored.left_out, heads)
    recording.file(RECORDING_FILE).write_text(document.model_dump_json(indent=2) + "\n", encoding="utf-8")
    return FilmedScan(recording.finish(stored.scan), stored.films, stored.left_out)


def _placed(story: ScanStory, camera: RigCamera, filmed: FilmedPass, heads: Heads) -> FilmFrames:
    if camera.id in filmed.failed:
        raise Finding(filmed.failed[camera.id])
    if (tally := filmed.films.get(film_name(camera.id))) is None:
        raise Finding("gave no frame on the travel")
    motion = motion_of_head(heads.log, camera.on_head, filmed.travel)
    ends = _ends(story, heads.carriages.aside_mm(camera.on_head))
    return place_frames(
        tally, filmed.times[camera.id], filmed.travel, motion, story.timing(camera), ends, LARGEST_SD_MM
    )


def _ends(story: ScanStory, aside_mm: float) -> tuple[float, float]:
    """Begin and end of the film of a head that stands aside of its carriage, X in mm."""
    return story.plan.start_mm + aside_mm, story.plan.end_mm + aside_mm


def _store_camera(
    camera: RigCamera, film: FilmFrames, filmed: FilmedPass, heads: Heads, story: ScanStory, recording: ScanRecording
) -> dict[str, object]:
    """Close the films of a camera; returns its entry in scan.yaml."""
    name, dark = film_name(camera.id), film_name(camera.id, background=True)
    recording.close_film(name, film.arrivals, len(film.x_mm))
    write_positions(recording.file(f"{name}.csv"), film.x_mm.tolist())
    entry: dict[str, object] = {"id": camera.id, "file": f"{GROUP}/{name}", "positions": f"{name}.csv"}
    background, count = _background(camera, film, filmed, heads, story)
    if background:
        recording.close_film(dark, background, count)
        entry["background"] = f"{GROUP}/{dark}"
    else:
        recording.drop_film(dark)
    return entry


def _background(
    camera: RigCamera, film: FilmFrames, filmed: FilmedPass, heads: Heads, story: ScanStory
) -> tuple[dict[int, int], int]:
    """Choose the laser-off frames: one per frame of the film if the way back was filmed, else one for all."""
    tally = filmed.films.get(film_name(camera.id, background=True))
    if tally is None:
        return {}, 0
    times, timing = filmed.times[camera.id], story.timing(camera)
    if filmed.back is not None:
        ends = _ends(story, heads.carriages.aside_mm(camera.on_head))
        motion = motion_of_head(heads.log, camera.on_head, filmed.back)
        back = place_frames(tally, times, filmed.back, motion, timing, ends, LARGEST_SD_MM)
        return nearest_frames(film, back), len(film.x_mm)
    standing = standing_frame(tally, times, timing, filmed.before)
    return ({}, 0) if standing is None else ({0: standing}, 1)


def expected_bytes(rig: Rig, travel_mm: float) -> int:
    """Expected size of the frames of all cameras on a travel."""
    return round(len(rig.cameras) * travel_mm / rig.travel.mm_per_s * rig.frames_per_second * FRAME_BYTES)


def next_scan_name(archive: Path, patient: str, side: Literal["right", "left"], date: datetime.date) -> str:
    """The first free name such as `2026-11-20-R`, `2026-11-20-R-2`; RefusedInput if 999 are taken."""
    first = f"{date.isoformat()}-{side[0].upper()}"
    names = [first, *(f"{first}-{number}" for number in range(2, MOST_SCANS + 1))]
    for name in names:
        if not (archive / patient / name).exists():
            return name
    raise RefusedInput(archive / patient, f"has {MOST_SCANS} scans of this day and side, expected fewer")
