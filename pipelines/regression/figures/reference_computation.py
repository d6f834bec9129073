"""A fixed computation that tells how fast a machine is at the moment: times are told as multiples of it.

It uses what the steps use, decoding, sorting and neighbours in space, but no line of the project: a step that becomes
slower must not slow what it is measured by. Nor anything that some processors have instructions of their own for, which
few steps gain from: NumPy's default sort takes a sixth of its time with AVX-512, the stable one all of it.
"""

import time
from functools import cache

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from scipy.spatial import cKDTree

FRAMES = 4


def reference_seconds() -> float:
    """Do it once; returns how long it took, about 0.03 s on one core."""
    jpeg, points = _material()
    start = time.perf_counter()
    for _ in range(FRAMES):
        frame = simplejpeg.decode_jpeg(jpeg, fastdct=False, fastupsample=False)
    np.sort(frame[..., 0].astype(np.float32), axis=0, kind="stable")
    cKDTree(points).query(points, k=4)
    return time.perf_counter() - start


@cache
def _material() -> tuple[bytes, NDArray[np.float64]]:
    """A frame and a cloud that are the same everywhere."""
    random = np.random.default_rng(0)
    j, i = np.mgrid[0:480, 0:640]
    stripe = 180 * np.exp(-0.5 * ((i - 320 - 60 * np.sin(j / 80)) / 4) ** 2)
    noise = random.normal(30, 5, (480, 640, 3))
    frame = np.clip(noise + stripe[..., None] * [1.0, 0.2, 0.15], 0, 255).astype(np.uint8)
    return simplejpeg.encode_jpeg(frame, 85, "RGB", "420"), random.uniform(0, 100, (4000, 3))
