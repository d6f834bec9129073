"""The fused cloud without outliers, with the count of what was removed and why."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.cloud.outliers import remove_outliers
from pipelines.arrays import pack, unpack
from schemas.errors import Finding
from schemas.parameters.outliers import OutlierParameters


def run(inputs: Mapping[str, bytes], parameters: OutlierParameters, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `cloud`."""
    del places
    cloud, removed = remove_outliers(unpack(inputs["cloud"])["cloud"], parameters)
    if not len(cloud):
        raise Finding("every point is an outlier, expected a foot in the control volume")
    counts = json.dumps({str(camera): reasons for camera, reasons in removed.items()}, sort_keys=True)
    return pack(cloud=cloud, removed=np.frombuffer(counts.encode(), np.uint8))
