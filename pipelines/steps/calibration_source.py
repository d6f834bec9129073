"""A calibration to its name, digest and origin."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

from schemas.base.model import canonical_json
from schemas.calibration import calibration_from_json
from schemas.used_calibration import UsedCalibration


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Return name, digest and origin of the calibration, as JSON.

    `inputs`: the `calibration`, and the `name` of the capture that it was made from.
    """
    del parameters, places
    content, name = inputs["calibration"], json.loads(inputs["name"])
    made = calibration_from_json(content.decode(), name)
    source = UsedCalibration(
        name=name, sha256=hashlib.sha256(content).hexdigest(), created=made.created, software=made.software
    )
    return canonical_json(source.model_dump(mode="json")).encode()
