"""A calibration to its name and digest."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

from schemas.base.model import canonical_json
from schemas.calibration import Source


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Return name and digest of the calibration, as JSON.

    `inputs`: the `calibration`, and the `name` of the capture that it was made from.
    """
    del parameters, places
    source = Source(name=json.loads(inputs["name"]), sha256=hashlib.sha256(inputs["calibration"]).hexdigest())
    return canonical_json(source.model_dump(mode="json")).encode()
