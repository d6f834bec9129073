"""The laser-off frames of one camera to frames in Zarr; the result is the manifest of these frames."""

from collections.abc import Mapping
from pathlib import Path

from footscan.frames.ingest import ingest_background
from schemas.base.model import canonical_json
from schemas.frames import FrameManifest


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Write laser-off frames to a Zarr array, and return their manifest as JSON.

    `inputs`: `manifest` of the film; `places`: the `background`, and the `array` to be written.
    """
    del parameters
    film = FrameManifest.model_validate_json(inputs["manifest"])
    manifest = ingest_background(places["background"], places["array"], len(film.frames), film.size)
    return canonical_json(manifest.model_dump(mode="json")).encode()
