"""The reference object, filmed by the virtual scanner; the result is the digests of the capture's files."""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from footscan.virtual.filming.capture import record_capture
from footscan.virtual.stage.reference import standard_reference
from schemas.base.model import canonical_json
from schemas.parameters.simulation import SimulationSettings
from schemas.reference import ReferenceObject

PLACEMENTS = 5
"""Number of placements that are filmed, enough to fill the measured volume. Chosen by hand."""


def run(inputs: Mapping[str, bytes], parameters: SimulationSettings, places: Mapping[str, Path]) -> bytes:
    """Film the reference object, and return the digests of the files by name, as JSON.

    `places`: the `folder` of the capture.
    """
    del inputs
    folder = places["folder"]
    record_capture(folder, filmed_reference(), settings=parameters)
    return canonical_json(
        {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in sorted(folder.iterdir())}
    ).encode()


def filmed_reference() -> ReferenceObject:
    """Return the standard reference object with the first `PLACEMENTS` placements."""
    reference = standard_reference()
    return reference.model_copy(update={"placements_mm": reference.placements_mm[:PLACEMENTS]})
