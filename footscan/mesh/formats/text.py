"""Numbers, metadata and lines of text formats."""

import io
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from schemas.base.errors import one_line
from schemas.base.limits import refuse_beyond


def coordinates(values: NDArray[np.floating]) -> list[list[str]]:
    """Returns (N, K) numbers as text with the digits of single precision, so that all formats agree."""
    single = np.asarray(values, np.float32) + np.float32(0)  # -0 is 0
    words: list[list[str]] = single.astype("U16").tolist()
    return words


def metadata_lines(metadata: Mapping[str, str]) -> list[str]:
    """Returns a line for each entry, such as "side right", after "unit mm"."""
    return [f"{key} {one_line(value)}" for key, value in {"unit": "mm", **metadata}.items()]


def lines_of(content: bytes) -> Iterator[bytes]:
    """Returns the lines of a text with any kind of line ends; raises BeyondLimitError if there are too many."""
    if b"\r" in content:
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    refuse_beyond("mesh_rows", content.count(b"\n"), "mesh")
    return iter(io.BytesIO(content))
