"""A world to the stripe points of its cameras over a body, when its scanner was calibrated."""

from collections.abc import Mapping
from pathlib import Path

from footscan.virtual.optics.scene import Mesh
from footscan.virtual.worlds.machine import machine_of, when_calibrated
from footscan.virtual.worlds.stripes import world_stripes
from footscan.virtual.worlds.subject import make_body
from pipelines.arrays import pack, unpack
from schemas.world import World


def run(inputs: Mapping[str, bytes], parameters: World, places: Mapping[str, Path]) -> bytes:
    """Compute `stripe-N` of each camera. `inputs`: the `body`, a closed mesh with `vertices`, mm, and `faces`."""
    del places
    shape = unpack(inputs["body"])
    body = make_body(Mesh(shape["vertices"], shape["faces"]), parameters.seed)
    by_camera = world_stripes(when_calibrated(machine_of(parameters)), body)
    return pack(**{f"stripe-{camera}": stripe for camera, stripe in by_camera.items()})
