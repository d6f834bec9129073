"""Pictures of the frames and of the removed points, for the report; drawn while the surface is made."""

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np

from footscan.cloud.outliers.remove import NO_POINT
from footscan.cloud.points import joined, of_cameras
from footscan.frames.array import IngestedFrames
from footscan.frames.reader import pixel_frames
from footscan.report.sample_frames import FrameSample, crop, cut_out
from footscan.report.scan.pictures import scan_pictures
from footscan.side_by_side import together
from footscan.stripe.points import StripePoints
from pipelines.arrays import pack, unpack
from schemas.frames import FrameManifest

FRAMES_SHOWN = 12
"""Frames of each camera along the travel that the page shows; chosen by hand."""


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Draw the pictures of a scan: packed `frames` and `removed`, their markup as UTF-8.

    `inputs`: `clean`; for each camera `manifest-N`, `stripe-N` and `points-N`; `places`: each camera's array of frames,
    `array-N`.
    """
    del parameters
    ids = sorted(int(name.partition("-")[2]) for name in inputs if name.startswith("stripe-"))
    points = joined(unpack(inputs[f"points-{camera}"])["points"] for camera in ids)
    codes = unpack(inputs["clean"])["codes"]
    is_point = codes != NO_POINT
    drawn = scan_pictures(of_cameras(points.compress(is_point)), codes[is_point], _samples(ids, inputs, places))
    return pack(**{name: np.frombuffer(markup.encode(), np.uint8) for name, markup in drawn._asdict().items()})


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
