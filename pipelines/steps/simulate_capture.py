"""The reference object, filmed by the virtual scanner; the result are the digests of the capture's files."""

from collections.abc import Mapping
from pathlib import Path

from footscan.virtual.filming.capture import record_capture
from footscan.virtual.stage.reference import standard_reference
from pipelines.engine.files.digest import sha256
from schemas.base.documents import canonical_json
from schemas.parameters.simulation import SimulationSettings

PLACEMENTS = 5
"""They fill the volume."""


def run(inputs: Mapping[str, bytes], parameters: SimulationSettings, places: Mapping[str, Path]) -> bytes:
    """`places`: the `folder` of the capture."""
    del inputs
    folder = places["folder"]
    reference = standard_reference()
    reference = reference.model_copy(update={"placements_mm": reference.placements_mm[:PLACEMENTS]})
    record_capture(folder, reference, settings=parameters)
    return canonical_json({file.name: sha256(file.read_bytes()) for file in sorted(folder.iterdir())}).encode()
