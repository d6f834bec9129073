"""A world to the stripe points of its cameras, the chart of its scanner, and its truth."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.virtual.worlds.chart import world_chart
from footscan.virtual.worlds.judge import Truth
from footscan.virtual.worlds.machine import machine_of
from footscan.virtual.worlds.stripes import world_stripes
from footscan.virtual.worlds.subject import make_subject
from pipelines.arrays import pack
from schemas.base.model import canonical_json
from schemas.world import World


def run(inputs: Mapping[str, bytes], parameters: World, places: Mapping[str, Path]) -> bytes:
    """Compute a world without pictures.

    The result holds `stripe-N` of each camera, the `chart` (CSV), the `vertices`, mm, scanner frame, and `faces` of the
    true surface, the share of it that is `covered` by stripe points, and the true `measures` (JSON).
    """
    del inputs, places
    machine, subject = machine_of(parameters), make_subject(parameters.subject)
    by_camera = world_stripes(machine, subject)
    seen = np.concatenate([stripe["place"] for stripe in by_camera.values()]).astype(np.float64)
    covered = Truth(subject.mesh).covered(seen[np.isfinite(seen[:, 0])])
    stripes = {f"stripe-{camera}": stripe for camera, stripe in by_camera.items()}
    texts = {"chart": world_chart(machine), "measures": canonical_json(subject.measures)}
    return pack(
        vertices=machine.plate.apply(subject.mesh.vertices),
        faces=subject.mesh.faces,
        covered=np.array(covered),
        **stripes,
        **{name: np.frombuffer(text.encode(), np.uint8) for name, text in texts.items()},
    )
