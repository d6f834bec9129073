"""The film of one camera to frames in Zarr; the result is the manifest of the frames."""

from collections.abc import Mapping
from pathlib import Path

from footscan.frames.ingest import ingest_film
from schemas.base.model import canonical_json


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Write the frames of a film to a Zarr array, and return their manifest as JSON.

    `places`: `film`, and the `array` to be written.
    """
    del inputs, parameters
    manifest = ingest_film(places["film"], places["array"])
    return canonical_json(manifest.model_dump(mode="json")).encode()
