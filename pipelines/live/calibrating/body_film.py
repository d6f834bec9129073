"""The film of the body that shows the laser planes: the heads travel over it one after the other."""

import datetime
import shutil
from pathlib import Path

import numpy as np

from footscan.calibration.travel.body import Body
from footscan.capture.passes import PassPlan
from footscan.capture.recording import ScanRecording
from pipelines.live.calibrating.stills import still_x_mm
from pipelines.live.devices import passes_of, timing_of
from pipelines.live.light import ScanLight
from pipelines.live.recording_document import ScanStory
from pipelines.live.scanner import LiveScanner
from pipelines.live.storing import ScanName, expected_bytes, store_scan
from schemas.rig import Rig

MARGIN_MM = 8.0
"""The travel begins and ends so far beside the body. Chosen by hand: as far as a person may place it off."""


def film_body(scanner: LiveScanner, place: Path, body: Body, light: ScanLight | None) -> None:
    """Film the body, whose middle is at `still_x_mm`, into the folder `place`; an earlier film there is removed.

    The heads move at the speed of scans: how late a camera exposes cannot be told from where its plane lies, and does
    no harm at that speed. Without a light, one is chosen first.
    """
    rig = scanner.rig
    for camera in rig.cameras:
        timing_of(camera)
    shutil.rmtree(place, ignore_errors=True)
    start_mm, end_mm = travel_over(rig, body)
    started = datetime.datetime.now().astimezone()
    name = ScanName(place.parent.name, place.name, "unknown", started.date())
    by_head = {
        head: [camera.id for camera in rig.cameras if camera.on_head == head] for head in range(1, 1 + len(rig.heads))
    }
    parts = [(head, part) for head, cameras in by_head.items() if cameras for part in passes_of(rig, cameras)]
    with ScanRecording(place, expected_bytes(rig, abs(end_mm - start_mm))) as recording:
        with scanner.ready_to_film():
            if light is None:
                light = scanner.measured_light(passes_of(rig, [camera.id for camera in rig.cameras]), [still_x_mm(rig)])
            story = ScanStory(
                started,
                light,
                [part for _, part in parts],
                PassPlan(start_mm, end_mm, rig.travel.mm_per_s, light.power),
            )
            for head, part in parts:
                scanner.heads.travel_to(scanner.heads.reach_mm[0])  # the other heads light nothing there
                plan = PassPlan(start_mm, end_mm, rig.travel.mm_per_s, light.power, head=head)
                story.filmed.append(
                    scanner.film_one_pass(part, plan, light, recording, f"the body, head {head}", story)
                )
        recording.settle()
        store_scan(rig, name, story, scanner.heads, recording, keep_partial=False)


def travel_over(rig: Rig, body: Body) -> tuple[float, float]:
    """Begin and end of the travel over a body at `still_x_mm`, whichever way it is turned, X in mm."""
    reach_mm = float(np.hypot(*np.ptp(body.vertices[:, :2], axis=0))) / 2.0 + MARGIN_MM
    middle_mm = still_x_mm(rig)
    return max(middle_mm - reach_mm, rig.travel.start_mm), min(middle_mm + reach_mm, rig.travel.end_mm)
