"""The page that a person opens."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.frames.ingest import discard
from footscan.frames.reader import read_frame
from footscan.report.sample_frames import FrameSample
from footscan.report.scan_page import scan_page
from pipelines.arrays import unpack
from schemas.calibration import Calibration
from schemas.errors import DamagedError
from schemas.frames import FrameManifest
from schemas.measures import Measures
from schemas.parameters.foot import FootParameters
from schemas.quality import Quality


def run(inputs: Mapping[str, bytes], parameters: FootParameters, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `calibration`, `oriented`, `surface`, `measures`, `quality`, `about` and, where there is a truth,
    `verified`; for each camera `manifest-N` and `stripe-N`; `places`: each camera's array of frames, `array-N`."""
    surface = unpack(inputs["surface"])
    about = json.loads(inputs["about"])
    ids = sorted(int(name.partition("-")[2]) for name in inputs if name.startswith("stripe-"))
    page = scan_page(
        patient=about["patient"],
        scan=about["scan"],
        side=parameters.side,
        vertices=surface["vertices"],
        faces=surface["faces"],
        cloud=unpack(inputs["oriented"])["cloud"],
        measures=Measures.model_validate_json(inputs["measures"]),
        quality=Quality.model_validate_json(inputs["quality"]),
        calibration=Calibration.model_validate_json(inputs["calibration"]),
        samples=[sample for camera in ids for sample in _samples(camera, inputs, places)],
        truth_distance=unpack(inputs["verified"])["vertex_distance"] if "verified" in inputs else None,
        provenance=about["provenance"],
    )
    return page.encode()


def _samples(camera: int, inputs: Mapping[str, bytes], places: Mapping[str, Path]) -> list[FrameSample]:
    """The frame of a camera with the most stripe points, where it has any."""
    stripe = unpack(inputs[f"stripe-{camera}"])["stripe"]
    if not len(stripe):
        return []
    number = int(np.argmax(np.bincount(stripe["frame"])))
    manifest = FrameManifest.model_validate_json(inputs[f"manifest-{camera}"])
    array = places[f"array-{camera}"]
    try:
        image = read_frame(array, manifest, number)
    except DamagedError:
        discard(array)
        raise
    points = stripe[stripe["frame"] == number]
    return [] if image is None else [FrameSample(camera, number, image, points["i"], points["j"])]
