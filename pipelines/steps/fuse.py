"""The points of all cameras to one cloud, with the agreement of the cameras."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.cloud.fusion.fuse import fuse
from pipelines.arrays import pack, unpack
from schemas.parameters.fusion import FusionParameters


def run(inputs: Mapping[str, bytes], parameters: FusionParameters, places: Mapping[str, Path]) -> bytes:
    """Fuse the points of all cameras to one cloud.

    `inputs`: `clean`. The result holds the `cloud` and the fusion `report`.
    """
    del places
    cleaned = unpack(inputs["clean"])
    heads = {int(camera): head for camera, head in json.loads(cleaned["heads"].tobytes()).items()}
    fusion = fuse(cleaned["points"], parameters, heads)
    return pack(cloud=fusion.cloud, report=np.frombuffer(fusion.report.model_dump_json().encode(), np.uint8))
