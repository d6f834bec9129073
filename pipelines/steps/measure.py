"""Mesh to measures.json."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.measure.foot_landmarks import check_manual
from footscan.measure.scanned_foot import measure_scanned_foot
from footscan.mesh.mesh import Mesh
from pipelines.arrays import unpack
from pipelines.scan_evidence import evidence_of
from schemas.base.errors import Finding, RefusedInput
from schemas.glass import GlassPlane
from schemas.heads import HeadsReport
from schemas.measures import Measures
from schemas.parameters.foot import MeasureParameters


def run(inputs: Mapping[str, bytes], parameters: MeasureParameters, places: Mapping[str, Path]) -> bytes:
    """Measure the foot, as measures.json.

    `inputs`: `surface`, `clean` for the glass and how the foot moved, `heads`, where they were, `fused` for how cameras
    agree; `calibration-doubt`, a sentence, if a check of the calibration gave reason for one; and `landmarks`, those
    that a person has set, x, y and z by name, in mm in the scanner's frame; `places`: their file. A foot that cannot be
    measured gives a document with the finding.
    """
    surface = unpack(inputs["surface"])
    glass = GlassPlane.model_validate_json(unpack(inputs["clean"])["glass"].tobytes())
    checked = json.loads(inputs["calibration-doubt"]) if "calibration-doubt" in inputs else None
    doubts = [*filter(None, [checked, HeadsReport.model_validate_json(inputs["heads"]).doubt])]
    manual = {name: np.array(point) for name, point in json.loads(inputs.get("landmarks", b"{}")).items()}
    try:
        check_manual(manual, surface["vertices"])
    except ValueError as error:
        raise RefusedInput(places["landmarks"], str(error)) from None
    mesh = Mesh(surface["vertices"], surface["faces"], filled=surface["filled"])
    try:
        measures = measure_scanned_foot(
            mesh, parameters.side, glass, doubts, evidence_of(inputs), parameters.axis, manual
        )
    except Finding as finding:  # the other results are still of use
        unmoved = np.eye(4).tolist()
        measures = Measures(
            side=parameters.side, doubts=doubts, axis=None, transform=unmoved, measures={}, finding=str(finding)
        )
    measures = measures.model_copy(update={"posture": parameters.posture})
    return (measures.model_dump_json(indent=2) + "\n").encode()
