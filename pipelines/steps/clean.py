"""The points of all cameras without outliers, with the number of removed points by reason."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.cloud.outliers import remove_outliers
from footscan.cloud.views import views_of
from pipelines.arrays import pack, unpack
from schemas.base.errors import Finding
from schemas.calibration import Calibration
from schemas.parameters.outliers import OutlierParameters


def run(inputs: Mapping[str, bytes], parameters: OutlierParameters, places: Mapping[str, Path]) -> bytes:
    """Remove the outliers from the points of all cameras.

    `inputs`: `points-N` of each camera and the `calibration` of all. The result holds the kept `points`, the `codes` of
    all points, and the counts of `removed` points by camera and reason.

    Raises
    ------
    Finding
        No camera has a point, or all points are outliers.
    """
    del places
    views = views_of(Calibration.model_validate_json(inputs["calibration"]).cameras)
    cameras = sorted((name for name in inputs if name.startswith("points-")), key=lambda name: int(name[7:]))
    points = np.concatenate([unpack(inputs[name])["points"] for name in cameras])
    if not len(points):
        raise Finding("no stripe in any camera, expected a foot in the films")
    kept, removed = remove_outliers(points, views, parameters)
    if not len(kept):
        raise Finding("every point is an outlier, expected a foot in the control volume")
    counts = json.dumps({str(camera): reasons for camera, reasons in removed.counts.items()}, sort_keys=True)
    return pack(points=kept, codes=removed.codes, removed=np.frombuffer(counts.encode(), np.uint8))
