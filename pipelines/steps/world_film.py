"""A world to the films of its cameras."""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from footscan.virtual.worlds.film.record import record_world
from schemas.base.model import canonical_json
from schemas.world import World


def run(inputs: Mapping[str, bytes], parameters: World, places: Mapping[str, Path]) -> bytes:
    """Film a world into the `folder` of `places`. The result holds the digests of the films, by name."""
    del inputs
    folder = places["folder"]
    record_world(parameters, folder, workers=1)
    digests = {film.name: hashlib.sha256(film.read_bytes()).hexdigest() for film in sorted(folder.glob("*.avi"))}
    return canonical_json(digests).encode()
