"""A chart of control points to a calibration file."""

from collections.abc import Mapping
from pathlib import Path

from footscan.calibration.chart import read_chart
from footscan.calibration.from_chart import calibrate_chart
from pipelines.engine.digest import sha256
from pipelines.version import SOFTWARE
from schemas.calibration import Source
from schemas.errors import DamagedError
from schemas.parameters.calibration import CalibrationParameters


def run(inputs: Mapping[str, bytes], parameters: CalibrationParameters, places: Mapping[str, Path]) -> bytes:
    """`inputs`: the `chart`; `places`: the `chart`'s file."""
    file = places["chart"]
    if file.read_bytes() != inputs["chart"]:
        raise DamagedError(f"{file}: is not the chart that was written, expected it unchanged")
    calibration, _ = calibrate_chart(
        read_chart(file),
        parameters=parameters,
        source=Source(name=file.name, sha256=sha256(inputs["chart"])),
        software=SOFTWARE,
    )
    return (calibration.model_dump_json(indent=2) + "\n").encode()
