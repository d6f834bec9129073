"""Normals of the fused cloud."""

from collections.abc import Mapping
from pathlib import Path

from footscan.cloud.normals import estimate_normals
from footscan.cloud.points import of_cameras
from footscan.cloud.views import views_of
from pipelines.arrays import pack, unpack
from schemas.calibration import Calibration
from schemas.parameters.normals import NormalParameters


def run(inputs: Mapping[str, bytes], parameters: NormalParameters, places: Mapping[str, Path]) -> bytes:
    """Estimate the normals of the fused cloud.

    `inputs`: `fused` and the `calibration` of all cameras. From here on the points bear the numbers of cameras, and not
    of views.
    """
    del places
    cloud = unpack(inputs["fused"])["cloud"]
    views = views_of(Calibration.model_validate_json(inputs["calibration"]).cameras)
    return pack(cloud=of_cameras(cloud), normals=estimate_normals(cloud, views, parameters))
