"""A world to the films of its cameras."""

from collections.abc import Mapping
from pathlib import Path

from footscan.virtual.worlds.film.record import record_world
from pipelines.engine.files.digest import sha256
from schemas.base.model import canonical_json
from schemas.world import World


def run(inputs: Mapping[str, bytes], parameters: World, places: Mapping[str, Path]) -> bytes:
    """Film a world into the `folder` of `places`. The result holds the digests of the films, by name."""
    del inputs
    folder = places["folder"]
    record_world(parameters, folder, workers=1)
    return canonical_json({film.name: sha256(film.read_bytes()) for film in sorted(folder.glob("*.avi"))}).encode()
