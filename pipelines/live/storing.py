"""What was filmed, into the archive: films with their places, scan.yaml, and how it all came about."""

import datetime
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

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
from pipelines.live.recording_document import ScanStory, recording_document
from schemas.base.errors import Finding, FootscanError, RefusedInput
from schemas.frames import GROUP
from schemas.rig import Rig, RigCamera
from schemas.scan import Scan

LARGEST_SD_MM = 0.3
"""A frame whose place is known less well is lost: its place is never guessed."""


@dataclass(frozen=True)
class ScanName:
    """Whose foot, and what the scan is called."""

    patient: str
    scan: str
    side: Literal["right", "left"]
    date: datetime.date


@dataclass(frozen=True)
class FilmedScan:
    """A scan that was stored."""

    place: Path
    films: dict[int, FilmFrames]
    """Of each camera that is in it."""
    left_out: dict[int, str] = field(default_factory=dict)
    """Cameras that are not, and why."""


def store_scan(
    rig: Rig,
    name: ScanName,
    story: ScanStory,
    heads: Heads,
    recording: ScanRecording,
    keep_partial: bool,
) -> FilmedScan:
    """Gives the frames their places and the scan its own.

    Raises
    ------
    Finding
        A camera's film is not whole, and `keep_partial` was not asked for; or none is.
    Fault
        The disk refuses.
    """
    films: dict[int, FilmFrames] = {}
    left_out: dict[int, str] = {}
    entries = []
    for one in story.filmed:
        for camera in (camera for camera in rig.cameras if camera.id in one.cameras):
            try:
                film = _placed(story, camera, one, heads)
            except FootscanError as error:
                left_out[camera.id] = str(error)
                continue
            if film.problem is not None:
                left_out[camera.id] = film.problem
                continue
            films[camera.id] = film
            entries.append(_store_camera(camera, film, one, heads, story, recording))
    if left_out and (not keep_partial or not films):
        told = "; ".join(f"camera {camera}: {problem}" for camera, problem in sorted(left_out.items()))
        raise Finding(f"the scan is not whole: {told}")
    for camera_id in left_out:
        for background in (False, True):
            recording.drop_film(film_name(camera_id, background=background))
    scan = Scan.model_validate(
        {
            "format": "footscan.scan/1",
            "patient": name.patient,
            "scan": name.scan,
            "side": name.side,
            "date": name.date,
            "scanner": rig.scanner,
            "cameras": sorted(entries, key=lambda entry: int(str(entry["id"]))),
        }
    )
    document = recording_document(rig, story, films, left_out, heads)
    recording.file("recording.json").write_text(document.model_dump_json(indent=2) + "\n", encoding="utf-8")
    return FilmedScan(recording.finish(scan), films, left_out)


def _placed(story: ScanStory, camera: RigCamera, one: FilmedPass, heads: Heads) -> FilmFrames:
    if camera.id in one.failed:
        raise Finding(one.failed[camera.id])
    if (tally := one.films.get(film_name(camera.id))) is None:
        raise Finding("gave no frame on the travel")
    motion = motion_of_head(heads.log, camera.on_head, one.travel)
    ends = (story.plan.start_mm, story.plan.end_mm)
    return place_frames(tally, one.times[camera.id], one.travel, motion, story.timing(camera), ends, LARGEST_SD_MM)


def _store_camera(
    camera: RigCamera, film: FilmFrames, one: FilmedPass, heads: Heads, story: ScanStory, recording: ScanRecording
) -> dict[str, object]:
    """Closes the films of one camera; its entry in scan.yaml."""
    name, dark = film_name(camera.id), film_name(camera.id, background=True)
    recording.close_film(name, film.arrivals, len(film.x_mm))
    write_positions(recording.file(f"{name}.csv"), film.x_mm.tolist())
    entry: dict[str, object] = {"id": camera.id, "file": f"{GROUP}/{name}", "positions": f"{name}.csv"}
    background, count = _background(camera, film, one, heads, story)
    if background:
        recording.close_film(dark, background, count)
        entry["background"] = f"{GROUP}/{dark}"
    else:
        recording.drop_film(dark)
    return entry


def _background(
    camera: RigCamera, film: FilmFrames, one: FilmedPass, heads: Heads, story: ScanStory
) -> tuple[dict[int, int], int]:
    """The laser-off frames: one for each of the film where the way back was filmed, else one for all."""
    tally = one.films.get(film_name(camera.id, background=True))
    if tally is None:
        return {}, 0
    times, timing = one.times[camera.id], story.timing(camera)
    if one.back is not None:
        ends = (story.plan.start_mm, story.plan.end_mm)
        motion = motion_of_head(heads.log, camera.on_head, one.back)
        back = place_frames(tally, times, one.back, motion, timing, ends, LARGEST_SD_MM)
        return nearest_frames(film, back), len(film.x_mm)
    standing = standing_frame(tally, times, timing, one.before)
    return ({}, 0) if standing is None else ({0: standing}, 1)


def next_scan_name(archive: Path, patient: str, side: Literal["right", "left"], date: datetime.date) -> str:
    """`2026-11-20-R`, or with a number behind it where there is one of this name."""
    first = f"{date.isoformat()}-{side[0].upper()}"
    names = [first, *(f"{first}-{number}" for number in range(2, 1000))]
    for name in names:
        if not (archive / patient / name).exists():
            return name
    raise RefusedInput(archive / patient, "has 999 scans of this day and side, expected fewer")
