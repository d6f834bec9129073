"""What is known of a scan's quality, as quality.json."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.surface.quality import mesh_quality
from pipelines.arrays import unpack
from schemas.calibration import Source
from schemas.frames import FrameManifest
from schemas.quality import CameraQuality, Comparison, Quality


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `calibration` (its name and digest), `clean`, `surface`, `manifest-N` and `stripe-N` of each camera,
    `verified` where there is a truth."""
    del parameters, places
    clean = unpack(inputs["clean"])
    removed = json.loads(clean["removed"].tobytes())
    surface = unpack(inputs["surface"])
    ids = sorted(int(name.partition("-")[2]) for name in inputs if name.startswith("stripe-"))
    quality = Quality(
        calibration=Source.model_validate_json(inputs["calibration"]),
        cameras=[_camera(camera, inputs, removed.get(str(camera), {})) for camera in ids],
        cloud_points=len(clean["cloud"]),
        mesh=mesh_quality(surface["vertices"], surface["faces"]),
        truth=_truth(inputs),
    )
    return (quality.model_dump_json(indent=2) + "\n").encode()


def _camera(camera: int, inputs: Mapping[str, bytes], removed: dict[str, int]) -> CameraQuality:
    extracted = unpack(inputs[f"stripe-{camera}"])
    stripe = extracted["stripe"]
    return CameraQuality(
        camera=camera,
        frames=len(FrameManifest.model_validate_json(inputs[f"manifest-{camera}"]).frames),
        frames_lost=len(extracted["lost"]),
        frames_with_stripe=len(np.unique(stripe["frame"])),
        points=len(stripe),
        removed=removed,
    )


def _truth(inputs: Mapping[str, bytes]) -> Comparison | None:
    if "verified" not in inputs:
        return None
    return Comparison.model_validate_json(unpack(inputs["verified"])["comparison"].tobytes())
