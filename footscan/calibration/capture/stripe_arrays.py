"""The stripe of one camera over the reference object as named arrays."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def stripe_arrays(
    stripes: Sequence[Floats], image_px: tuple[int, int], lost: Sequence[int]
) -> dict[str, NDArray[np.generic]]:
    """The stripes of one camera, (N, 2) px for each of K frames, the size of its images, px, and its lost frames."""
    return {
        "pixels": np.concatenate([np.empty((0, 2)), *stripes]),
        "counts": np.array([len(stripe) for stripe in stripes], np.int64),
        "image_px": np.array(image_px, np.int64),
        "lost": np.array(lost, np.int64),
    }
