"""A step that films the parametric foot of a suite with the virtual scanner."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.virtual.filming.record import ScanExtras, ScanName, record_scan
from footscan.virtual.foot.foot import make_foot
from footscan.virtual.optics.scene import Mesh
from footscan.virtual.stage.standing import stand_in_the_middle
from pipelines.engine.files.digest import sha256
from schemas.parameters.virtual_scan import VirtualScan

PATIENT = "virtual"


def run(inputs: Mapping[str, bytes], parameters: VirtualScan, places: Mapping[str, Path]) -> bytes:
    """`places`: the `folder` of the scan, which has the name of the scan.

    The result holds the true measures of the foot, mm, by name (`known`), and the digests of the `films`.
    """
    del inputs
    folder, settings = places["folder"], parameters.settings
    foot = make_foot(side=parameters.side)
    record_scan(
        Mesh(stand_in_the_middle(foot.vertices, settings), foot.faces.astype(np.int64)),
        folder,
        ScanName(PATIENT, folder.name, parameters.side),
        settings,
        extras=ScanExtras(laser_off=parameters.laser_off),
    )
    films = {film.name: sha256(film.read_bytes()) for film in sorted(folder.glob("*.avi"))}
    return (json.dumps({"known": foot.measures, "films": films}, indent=2, sort_keys=True) + "\n").encode()
