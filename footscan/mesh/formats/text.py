"""Numbers and words for formats of text."""

import io
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from schemas.base.errors import one_line
from schemas.base.limits import refuse_beyond


def coordinates(values: NDArray[np.floating]) -> list[list[str]]:
    """(N, K) numbers with as many digits as single precision needs: no format then differs from another."""
    single = np.asarray(values, np.float32) + np.float32(0)  # -0 is 0
    words: list[list[str]] = single.astype("U16").tolist()
    return words


def described(metadata: Mapping[str, str]) -> list[str]:
    """Lines for persons and for `known`: "unit mm" first, and "side right"."""
    return [f"{key} {one_line(value)}" for key, value in {"unit": "mm", **metadata}.items()]


def lines_of(content: bytes) -> Iterator[bytes]:
    """The lines of a text, whichever line ends it has; BeyondLimitError of too many."""
    if b"\r" in content:
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    refuse_beyond("mesh_rows", content.count(b"\n"), "mesh")
    return iter(io.BytesIO(content))
