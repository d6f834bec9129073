"""The parametric foot, filmed by the virtual scanner; the result is the true measures of the foot."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.virtual.filming.record import ScanName, record_scan
from footscan.virtual.foot.foot import make_foot
from footscan.virtual.optics.scene import Mesh
from footscan.virtual.stage.standing import stand_in_the_middle
from schemas.parameters.demo import FilmedFoot


def run(inputs: Mapping[str, bytes], parameters: FilmedFoot, places: Mapping[str, Path]) -> bytes:
    """Film the parametric foot, and return its true measures, as JSON.

    `places`: the `folder` of the scan.
    """
    del inputs
    foot = make_foot(side=parameters.side)
    record_scan(
        Mesh(stand_in_the_middle(foot.vertices, parameters.settings), foot.faces.astype(np.int64)),
        places["folder"],
        ScanName(parameters.patient, parameters.scan, parameters.side),
        parameters.settings,
    )
    return (json.dumps(foot.measures, indent=2, sort_keys=True) + "\n").encode()
