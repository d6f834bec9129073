"""Laser-off frames of one camera into Zarr, as its film is; the result is the manifest of these frames."""

from collections.abc import Mapping
from pathlib import Path

from footscan.frames.film import open_film, pixel_frames
from footscan.frames.ingest import FRAME_SIZE, ingest_film
from schemas.documents import canonical_json
from schemas.errors import RefusedInput
from schemas.frames import FrameManifest


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `manifest` of the film; `places`: the `background`, and the `array` to be written."""
    del parameters
    film = FrameManifest.model_validate_json(inputs["manifest"])
    manifest = ingest_background(places["background"], places["array"], len(film.frames))
    return canonical_json(manifest.model_dump(mode="json")).encode()


def ingest_background(background: Path, array: Path, frames: int) -> FrameManifest:
    """`ingest_film` for the background of a film of so many `frames`.

    Raises
    ------
    RefusedInput
        As in `ingest_film`; the background has neither one frame nor as many as the film, or its only one is torn.
    """
    film = open_film(background, FRAME_SIZE)
    if film.frames not in {1, frames}:
        problem = f"expected one frame or {frames}, as many as the film has, found {film.frames}"
        raise RefusedInput(background, problem, field="frames")
    if film.frames == 1 and next(pixel_frames(film)) is None:
        raise RefusedInput(background, "expected a whole frame, found one that is torn", field="frames")
    return ingest_film(background, array)
