"""The report of a scan: an HTML page."""

import json
from collections.abc import Mapping
from pathlib import Path

from footscan.report.scan.foot_colours import FootSurface
from footscan.report.scan.page import ScanTitle, scan_page
from footscan.report.scan.pictures import ScanPictures
from pipelines.arrays import unpack
from schemas.calibration import Calibration
from schemas.measures import Measures
from schemas.parameters.foot import FootParameters
from schemas.quality import Quality
from schemas.sizes import FootSizes


def run(inputs: Mapping[str, bytes], parameters: FootParameters, places: Mapping[str, Path]) -> bytes:
    """Make the page of a scan, as HTML.

    `inputs`: `calibration`, `pictures`, `oriented`, `surface`, `deviations`, `measures`, `quality`, `sizes`, `about`,
    `notes` of a person if there are any, and `verified` if the scan has a truth.
    """
    del places
    surface = unpack(inputs["surface"])
    about = json.loads(inputs["about"])
    drawn = unpack(inputs["pictures"])
    page = scan_page(
        title=ScanTitle(about["patient"], about["scan"], parameters.side),
        surface=FootSurface(
            vertices=surface["vertices"],
            faces=surface["faces"],
            filled=surface.get("filled"),
            deviations=unpack(inputs["deviations"])["deviations"],
            cut_mm=surface["cut_mm"].item() if "cut_mm" in surface else None,
            truth_distance=unpack(inputs["verified"])["vertex_distance"] if "verified" in inputs else None,
        ),
        cloud=unpack(inputs["oriented"])["cloud"],
        measures=Measures.model_validate_json(inputs["measures"]),
        quality=Quality.model_validate_json(inputs["quality"]),
        calibration=Calibration.model_validate_json(inputs["calibration"]),
        pictures=ScanPictures(**{name: drawn[name].tobytes().decode() for name in ScanPictures._fields}),
        provenance=about["provenance"],
        sizes=FootSizes.model_validate_json(inputs["sizes"]),
        notes=json.loads(inputs.get("notes", b'""')),
    )
    return page.encode()
