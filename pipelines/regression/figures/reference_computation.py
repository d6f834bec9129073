"""A fixed computation that measures the present speed of a machine: times are given as multiples of it.

It does what the steps do (decoding, sorting, neighbours in space), but uses no code of the project: a step that becomes
slower must not slow its own unit. It also avoids operations with special instructions on some processors, from which
few steps gain: with AVX-512 NumPy's default sort takes a sixth of its time, the stable sort all of it.
"""

import time
from functools import cache

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from schemas.base.image_size import FRAME_SIZE

FRAMES = 4
"""Frames that are decoded; chosen by hand so that the computation is short against a step."""


def reference_seconds() -> float:
    """Run the computation once and return its time, about 0.03 s on one core."""
    jpeg, points = _material()
    start = time.perf_counter()
    for _ in range(FRAMES):
        frame = simplejpeg.decode_jpeg(jpeg, fastdct=False, fastupsample=False)
    np.sort(frame[..., 0].astype(np.float32), axis=0, kind="stable")
    cKDTree(points).query(points, k=4)
    return time.perf_counter() - start


@cache
def _material() -> tuple[bytes, NDArray[np.float64]]:
    """A frame and a cloud, (4000, 3), that are the same on every machine."""
    random = np.random.default_rng(0)
    j, i = np.indices(FRAME_SIZE)
    stripe = 180 * np.exp(-0.5 * ((i - FRAME_SIZE.columns / 2 - 60 * np.sin(j / 80)) / 4) ** 2)
    noise = random.normal(30, 5, (*FRAME_SIZE, 3))
    frame = np.clip(noise + stripe[..., None] * [1.0, 0.2, 0.15], 0, 255).astype(np.uint8)
    return simplejpeg.encode_jpeg(frame, 85, "RGB", "420"), random.uniform(0, 100, (4000, 3))
