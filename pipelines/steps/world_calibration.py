"""The chart of a world's scanner to its calibration."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from footscan.calibration.chart.chart import read_chart
from footscan.calibration.chart.from_chart import calibrate_chart
from pipelines.arrays import unpack
from schemas.calibration import Source
from schemas.parameters.calibration import CalibrationParameters

CHART = "chart.csv"


def run(inputs: Mapping[str, bytes], parameters: CalibrationParameters, places: Mapping[str, Path]) -> bytes:
    """Calibrate from the `chart` of a `world`, as calibration.json.

    Raises
    ------
    RefusedInput
        As in `calibrate_chart`.
    """
    del places
    text = unpack(inputs["world"])["chart"].tobytes()
    with TemporaryDirectory() as folder:
        path = Path(folder) / CHART
        path.write_bytes(text)
        charts = read_chart(path)
    source = Source(name=CHART, sha256=hashlib.sha256(text).hexdigest())
    calibration, _ = calibrate_chart(charts, parameters=parameters, source=source, software="footscan worlds")
    return (calibration.model_dump_json(indent=2) + "\n").encode()
