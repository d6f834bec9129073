"""The report of a scan: an HTML page."""

import json
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np

from footscan.cloud.outliers.remove import NO_POINT
from footscan.cloud.points import joined, of_cameras
from footscan.frames.array import IngestedFrames
from footscan.frames.reader import pixel_frames
from footscan.mesh.mesh import Mesh
from footscan.report.sample_frames import FrameSample, crop, cut_out
from footscan.report.scan.foot_colours import FootSurface
from footscan.report.scan.page import ScanPoints, ScanTitle, scan_page
from footscan.side_by_side import together
from footscan.stripe.points import StripePoints
from footscan.surface.errors.scan_errors import scan_errors
from pipelines.arrays import unpack
from pipelines.scan_evidence import evidence_of
from schemas.calibration import Calibration
from schemas.frames import FrameManifest
from schemas.measures import Measures
from schemas.parameters.foot import FootParameters
from schemas.quality import Quality
from schemas.sizes import FootSizes

FRAMES_SHOWN = 12
"""Frames of each camera along the travel that the page shows; chosen by hand."""


def run(inputs: Mapping[str, bytes], parameters: FootParameters, places: Mapping[str, Path]) -> bytes:
    """Make the page of a scan, as HTML.

    `inputs`: `calibration`, `clean`, `fused`, `oriented`, `surface`, `measures`, `quality`, `sizes`, `about`, `notes`
    of a person if there are any, and `verified` if the scan has a truth; for each camera `manifest-N`, `stripe-N` and
    `points-N`; `places`: each camera's array of frames, `array-N`.
    """
    surface = unpack(inputs["surface"])
    about = json.loads(inputs["about"])
    ids = sorted(int(name.partition("-")[2]) for name in inputs if name.startswith("stripe-"))
    points = joined(unpack(inputs[f"points-{camera}"])["points"] for camera in ids)
    codes = unpack(inputs["clean"])["codes"]
    mesh = Mesh(surface["vertices"], surface["faces"], filled=surface.get("filled"))
    page = scan_page(
        title=ScanTitle(about["patient"], about["scan"], parameters.side),
        surface=FootSurface(
            vertices=surface["vertices"],
            faces=surface["faces"],
            filled=surface.get("filled"),
            deviations=scan_errors(mesh, evidence_of(inputs)).deviations,
            cut_mm=surface["cut_mm"].item() if "cut_mm" in surface else None,
            truth_distance=unpack(inputs["verified"])["vertex_distance"] if "verified" in inputs else None,
        ),
        points=ScanPoints(
            points=of_cameras(points.compress(codes != NO_POINT)),
            codes=codes[codes != NO_POINT],
            cloud=unpack(inputs["oriented"])["cloud"],
        ),
        measures=Measures.model_validate_json(inputs["measures"]),
        quality=Quality.model_validate_json(inputs["quality"]),
        calibration=Calibration.model_validate_json(inputs["calibration"]),
        samples=_samples(ids, inputs, places),
        provenance=about["provenance"],
        sizes=FootSizes.model_validate_json(inputs["sizes"]),
        notes=json.loads(inputs.get("notes", b'""')),
    )
    return page.encode()


def _samples(ids: Sequence[int], inputs: Mapping[str, bytes], places: Mapping[str, Path]) -> list[FrameSample]:
    """Frames of all cameras, equally spaced from the first to the last frame with a stripe, without lost frames."""
    stripes = {camera: unpack(inputs[f"stripe-{camera}"])["stripe"] for camera in ids}
    stripe_frames = np.concatenate([stripe["frame"] for stripe in stripes.values()])
    if not len(stripe_frames):
        return []
    spaced = np.linspace(stripe_frames.min(), stripe_frames.max(), FRAMES_SHOWN)
    numbers = np.unique(np.rint(spaced).astype(int)).tolist()
    of_cameras = together(
        partial(_of_camera, camera, stripe, numbers, inputs, places) for camera, stripe in stripes.items()
    )
    return list(chain.from_iterable(of_cameras))


def _of_camera(
    camera: int, stripe: StripePoints, numbers: Sequence[int], inputs: Mapping[str, bytes], places: Mapping[str, Path]
) -> list[FrameSample]:
    manifest = FrameManifest.model_validate_json(inputs[f"manifest-{camera}"])
    frames = IngestedFrames(places[f"array-{camera}"], manifest)
    filmed = [number for number in numbers if number < frames.count]
    shown = stripe[np.isin(stripe["frame"], filmed)]
    cut = crop(frames.size, shown["i"], shown["j"])
    samples = []
    for number, image in zip(filmed, pixel_frames(frames, filmed), strict=True):
        if image is not None:
            points = shown[shown["frame"] == number]
            samples.append(FrameSample(camera, number, cut, cut_out(image, cut), points["i"], points["j"]))
    return samples
