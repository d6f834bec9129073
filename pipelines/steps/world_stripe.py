"""The stripe points of one camera of a world, as the step `extract` gives them."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.stripe.points import STRIPE_DTYPE
from pipelines.arrays import pack, unpack


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Select the points of one camera. `inputs`: the `world`, and the number of the `camera`."""
    del parameters, places
    points = unpack(inputs["world"])[f"stripe-{json.loads(inputs['camera'])}"]
    stripe = np.zeros(len(points), STRIPE_DTYPE)
    for name in STRIPE_DTYPE.names or ():
        stripe[name] = points[name]
    return pack(stripe=stripe, lost=np.empty(0, np.int32))
