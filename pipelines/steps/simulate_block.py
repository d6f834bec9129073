"""The block of the thesis's Table 6-1, filmed by the virtual scanner."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.virtual.filming.record import ScanName, record_scan
from footscan.virtual.optics.scene import Mesh
from footscan.virtual.stage.block import make_block
from footscan.virtual.stage.standing import BLOCK_TURN_DEG, stand_in_the_middle
from schemas.parameters.demo import FilmedFoot


def run(inputs: Mapping[str, bytes], parameters: FilmedFoot, places: Mapping[str, Path]) -> bytes:
    """Film the block, turned so that no face is parallel to the laser planes; the result is empty JSON.

    `places`: the `folder` of the scan. Of `parameters`, the side is not used.
    """
    del inputs
    vertices, faces = make_block()
    record_scan(
        Mesh(stand_in_the_middle(vertices, parameters.settings, BLOCK_TURN_DEG), faces.astype(np.int64)),
        places["folder"],
        ScanName(parameters.patient, parameters.scan, "unknown"),
        parameters.settings,
    )
    return b"{}"
