"""The points of all cameras without outliers, with the number of removed points by reason."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from footscan.clean import clean
from footscan.cloud.heads.planes import corrected, heads_of
from footscan.cloud.points import joined
from footscan.cloud.views import views_of
from pipelines.arrays import pack, unpack
from schemas.base.errors import Finding
from schemas.calibration import Calibration
from schemas.heads import HeadsReport
from schemas.parameters.outliers import OutlierParameters


def run(inputs: Mapping[str, bytes], parameters: OutlierParameters, places: Mapping[str, Path]) -> bytes:
    """Remove the outliers from the points of all cameras.

    `inputs`: `points-N` of each camera, the `calibration` of all, `heads`, where they were, and `passes`, the number of
    the pass of each camera that did not film in the first one, if there is any. The result holds the kept `points`,
    with the movement of the foot taken back, the `codes` of all points, the counts of `removed` points by camera and
    reason, `warnings`, the `glass` below the foot, its `movement`, where the planes of its `lasers` lie, how far the
    ends are `contested`, X in mm, how far the stripes of other lasers are `parted` from the kept points, mm, and the
    `heads` of the cameras.

    Raises
    ------
    Finding
        No camera has a point, or all points are outliers.
    """
    del places
    calibrated = Calibration.model_validate_json(inputs["calibration"]).cameras
    views = views_of(calibrated)
    cameras = sorted((name for name in inputs if name.startswith("points-")), key=lambda name: int(name[7:]))
    mapped = {int(name[7:]): unpack(inputs[name]) for name in cameras}
    points = joined(of_camera["points"] for of_camera in mapped.values())
    if not len(points):
        raise Finding("no stripe in any camera, expected a foot in the films")
    filmed = {one.view: mapped[one.camera]["x_of_frame"] + one.ahead_mm for one in calibrated if one.camera in mapped}
    points, views = corrected(points, views, HeadsReport.model_validate_json(inputs["heads"]))
    passes = {int(camera): number for camera, number in json.loads(inputs.get("passes", b"{}")).items()}
    kept, removed, movement = clean(points, views, parameters, filmed, passes)
    counts = {str(camera): reasons for camera, reasons in removed.counts.items()}
    return pack(
        points=kept,
        codes=removed.codes,
        removed=_json(counts),
        warnings=_json([*removed.warnings, *movement.warnings]),
        glass=_json(removed.glass.model_dump(mode="json")),
        movement=_json(movement.model_dump(mode="json")),
        lasers=removed.lasers,
        contested=np.array(removed.contested_mm),
        parted=removed.parted_mm,
        heads=_json(heads_of(views)),
    )


def _json(content: object) -> NDArray[np.uint8]:
    return np.frombuffer(json.dumps(content, sort_keys=True).encode(), np.uint8)
