"""Where the heads were in a scan, beside where the calibration says."""

from collections.abc import Mapping
from pathlib import Path

from footscan.cloud.heads.find import find_heads
from footscan.cloud.points import joined
from footscan.cloud.views import views_of
from pipelines.arrays import unpack
from schemas.calibration import Calibration
from schemas.parameters.heads import HeadParameters


def run(inputs: Mapping[str, bytes], parameters: HeadParameters, places: Mapping[str, Path]) -> bytes:
    """Find the places of the heads, as a `schemas.heads.HeadsReport`.

    `inputs`: `points-N` of each camera and the `calibration` of all.
    """
    del places
    views = views_of(Calibration.model_validate_json(inputs["calibration"]).cameras)
    points = [unpack(inputs[name])["points"] for name in sorted(inputs) if name.startswith("points-")]
    report = find_heads(joined(points), views, parameters)
    return report.model_dump_json().encode()
