"""A capture of the reference object to a calibration file."""

import json
from collections.abc import Mapping
from pathlib import Path

from pipelines.calibrate import calibrate_capture
from pipelines.engine.files.digest import sha256
from pipelines.engine.pool import cores
from pipelines.recordings.captures import CAPTURE_FILE, read_capture
from schemas.base.errors import DamagedError
from schemas.parameters.calibration import CaptureCalibrationParameters


def run(inputs: Mapping[str, bytes], parameters: CaptureCalibrationParameters, places: Mapping[str, Path]) -> bytes:
    """`inputs`: the digests of the `capture`'s files by name; `places`: its `capture` folder."""
    folder = places["capture"]
    for name, digest in json.loads(inputs["capture"]).items():
        file = folder / name
        if not file.is_file() or sha256(file.read_bytes()) != digest:
            (folder / CAPTURE_FILE).unlink(missing_ok=True)  # without it the capture is none, and is filmed anew
            raise DamagedError(f"{file}: is not what was filmed; run again to film it anew")
    calibration = calibrate_capture(read_capture(folder), parameters, cores()).calibration
    return (calibration.model_dump_json(indent=2) + "\n").encode()
