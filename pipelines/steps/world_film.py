"""A world to the films of its cameras."""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from footscan.virtual.optics.scene import Mesh
from footscan.virtual.worlds.film.record import record_world
from pipelines.arrays import unpack
from schemas.base.model import canonical_json
from schemas.world import World


def run(inputs: Mapping[str, bytes], parameters: World, places: Mapping[str, Path]) -> bytes:
    """Film a world into the `folder` of `places`. The result holds the digests of the films, by name.

    `inputs`: a `body` that is filmed in place of the world's subject, a closed mesh with `vertices`, mm, and `faces`.
    """
    folder, body = places["folder"], None
    if "body" in inputs:
        shape = unpack(inputs["body"])
        body = Mesh(shape["vertices"], shape["faces"])
    record_world(parameters, folder, body=body, workers=1)
    digests = {film.name: hashlib.sha256(film.read_bytes()).hexdigest() for film in sorted(folder.glob("*.avi"))}
    return canonical_json(digests).encode()
