"""The quality of a scan, as quality.json without its warnings."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from footscan.surface.quality import mesh_quality
from pipelines.arrays import unpack
from schemas.calibration_check import ScanCheck
from schemas.frames import FrameManifest
from schemas.fusion import FusionReport
from schemas.glass import GlassPlane
from schemas.heads import HeadsReport
from schemas.laser import Laser
from schemas.movement import MovementReport
from schemas.quality import CameraQuality, Comparison, Quality
from schemas.used_calibration import UsedCalibration


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Collect the quality figures of a scan, as quality.json without its warnings.

    `inputs`: `calibration` (its name, digest and origin), `heads`, `clean`, `fused`, `surface`, `manifest-N` and
    `stripe-N` of each camera, `calibration-check` if the calibration was checked, and `verified` if the scan has a
    truth.
    """
    del parameters, places
    cleaned = unpack(inputs["clean"])
    removed = json.loads(cleaned["removed"].tobytes())
    fused = unpack(inputs["fused"])
    surface = unpack(inputs["surface"])
    cut_mm = surface["cut_mm"].item() if "cut_mm" in surface else None
    ids = sorted(int(name.partition("-")[2]) for name in inputs if name.startswith("stripe-"))
    quality = Quality(
        calibration=UsedCalibration.model_validate_json(inputs["calibration"]),
        calibration_check=_check(inputs),
        cameras=[_camera(camera, inputs, removed.get(str(camera), {})) for camera in ids],
        warnings=json.loads(cleaned["warnings"].tobytes()),
        heads=HeadsReport.model_validate_json(inputs["heads"]),
        movement=MovementReport.model_validate_json(cleaned["movement"].tobytes()),
        glass=GlassPlane.model_validate_json(cleaned["glass"].tobytes()),
        fusion=FusionReport.model_validate_json(fused["report"].tobytes()),
        cloud_points=len(fused["cloud"]),
        mesh=mesh_quality(surface["vertices"], surface["faces"], surface.get("filled"), cut_mm),
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
        laser=_laser(extracted),
        removed=removed,
    )


def _laser(extracted: Mapping[str, NDArray[Any]]) -> Laser | None:
    found = extracted["laser"].item() if "laser" in extracted else "auto"
    return None if found == "auto" else cast(Laser, found)


def _check(inputs: Mapping[str, bytes]) -> ScanCheck | None:
    check = inputs.get("calibration-check")
    return None if check is None else ScanCheck.model_validate_json(check)


def _truth(inputs: Mapping[str, bytes]) -> Comparison | None:
    if "verified" not in inputs:
        return None
    return Comparison.model_validate_json(unpack(inputs["verified"])["comparison"].tobytes())
