"""Film to frames: the camera's bytes into Zarr; the result is the manifest of the frames."""

from collections.abc import Mapping
from pathlib import Path

from footscan.frames.ingest import ingest_film
from schemas.base.model import canonical_json


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """`places`: `film`, and the `array` to be written."""
    del inputs, parameters
    manifest = ingest_film(places["film"], places["array"])
    return canonical_json(manifest.model_dump(mode="json")).encode()
