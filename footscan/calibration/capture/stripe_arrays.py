"""The stripe of one camera over the reference object as named arrays."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def stripe_arrays(
    stripes: Sequence[Floats], image_px: tuple[int, int], lost: Sequence[int]
) -> dict[str, NDArray[np.generic]]:
    """Convert the stripes of one camera to arrays.

    Parameters
    ----------
    stripes : for each of K frames the points (N, 2), px.
    image_px : columns and rows of the images.
    lost : numbers of the frames that cannot be decoded.

    Examples
    --------
    >>> arrays = stripe_arrays([np.zeros((3, 2)), np.zeros((1, 2))], (640, 480), [])
    >>> arrays["pixels"].shape, arrays["counts"].tolist()
    ((4, 2), [3, 1])
    """
    return {
        "pixels": np.concatenate([np.empty((0, 2)), *stripes]),
        "counts": np.array([len(stripe) for stripe in stripes], np.int64),
        "image_px": np.array(image_px, np.int64),
        "lost": np.array(lost, np.int64),
    }
