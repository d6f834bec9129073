"""Numbers and words for formats of text."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from schemas.errors import one_line


def coordinates(values: NDArray[np.floating]) -> list[list[str]]:
    """(N, K) numbers with as many digits as single precision needs: no format then differs from another."""
    single = np.asarray(values, np.float32) + np.float32(0)  # -0 is 0
    words: list[list[str]] = single.astype("U16").tolist()
    return words


def described(metadata: Mapping[str, str]) -> list[str]:
    """Lines for persons and for `known`: "unit mm" first, and "side right"."""
    return [f"{key} {one_line(value)}" for key, value in {"unit": "mm", **metadata}.items()]
