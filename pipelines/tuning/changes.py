"""The frames in which the points kept with two sets of parameters differ most."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.outliers.remove import KEPT
from footscan.frames.array import IngestedFrames
from footscan.frames.reader import pixel_frames
from footscan.recordings.scans import RecordedScan
from footscan.stripe.points import STRIPE_DTYPE, StripePoints
from pipelines.arrays import unpack
from pipelines.tuning.bench import Bench
from pipelines.tuning.report.result import FrameChange
from pipelines.tuning.report.stripe_change import change_by_frame
from schemas.base.errors import DamagedError
from schemas.frames import FrameManifest
from schemas.parameters.scan import ScanParameters

SCANS, FRAMES = 3, 8
"""Number of scans that are searched, and of frames that are shown; chosen by hand."""
APART = 5
"""Least distance of two frames shown of a film, since neighbouring frames look alike; chosen by hand."""


def frame_changes(
    bench: Bench, present: ScanParameters, winner: ScanParameters, scans: Sequence[RecordedScan]
) -> list[FrameChange]:
    """Find the frames of the first `SCANS` scans in which the kept points differ most; the greatest change first."""
    candidates: list[tuple[float, int, RecordedScan, int, int]] = []
    results = {}
    for place, scan in enumerate(scans[:SCANS]):
        pair = bench.results(present, scan), bench.results(winner, scan)
        kept = [_kept(step_results, scan) for step_results in pair]
        for camera in sorted(kept[0]):
            if f"ingest-{camera}" not in pair[0]:
                continue
            manifest = FrameManifest.model_validate_json(pair[0][f"ingest-{camera}"])
            results[scan.name, camera] = manifest, kept[0][camera], kept[1][camera]
            change = change_by_frame(kept[0][camera], kept[1][camera], len(manifest.frames))
            candidates += [(-c, place, scan, camera, frame) for frame, c in enumerate(change.tolist()) if c]
    shown: list[FrameChange] = []
    for _, _, scan, camera, frame in sorted(candidates, key=lambda row: (row[0], row[1], row[3], row[4])):
        if len(shown) == FRAMES:
            break
        if any((s.scan, s.camera) == (scan.name, camera) and abs(s.frame - frame) < APART for s in shown):
            continue
        manifest, before, after = results[scan.name, camera]
        array = next(scan.array(film) for film in scan.document.cameras if film.id == camera)
        try:
            image = next(pixel_frames(IngestedFrames(array, manifest), [frame]))
        except DamagedError:  # it is not shown; the next run ingests it anew
            continue
        if image is not None:
            shown.append(
                FrameChange(scan.name, camera, frame, image.copy(), _places(before, frame), _places(after, frame))
            )
    return shown


def _kept(results: Mapping[str, bytes], scan: RecordedScan) -> dict[int, StripePoints]:
    """Stripe points that the filter of outliers kept, by camera; `results` as of `Bench.results`."""
    codes = unpack(results["clean"])["codes"] if "clean" in results else None
    kept: dict[int, StripePoints] = {}
    first = 0
    for camera in sorted(film.id for film in scan.document.cameras):
        if f"map-{camera}" not in results or codes is None:
            kept[camera] = np.zeros(0, STRIPE_DTYPE)
            continue
        points = unpack(results[f"map-{camera}"])["points"]
        stay = points[codes[first : first + len(points)] == KEPT]
        kept[camera] = unpack(results[f"extract-{camera}"])["stripe"][stay["source"]]
        first += len(points)
    return kept


def _places(points: StripePoints, frame: int) -> NDArray[np.float64]:
    of_frame = points[points["frame"] == frame]
    return np.column_stack([of_frame["i"], of_frame["j"]])
