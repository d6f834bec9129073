"""The reference object, filmed by the virtual scanner; the result is the chart of its clicked corners."""

from collections.abc import Mapping
from pathlib import Path

from footscan.virtual.capture import record_capture
from footscan.virtual.reference import standard_reference
from schemas.parameters.simulation import SimulationSettings


def run(inputs: Mapping[str, bytes], parameters: SimulationSettings, places: Mapping[str, Path]) -> bytes:
    """`places`: the `folder` of the capture."""
    del inputs
    record_capture(places["folder"], standard_reference(), settings=parameters)
    return (places["folder"] / "chart.csv").read_bytes()
