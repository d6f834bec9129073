"""Bounds of the files that are read: they come from outside and must not exhaust the machine's memory or time.

A bound is raised by the environment variable `FOOTSCAN_LIMITS`, such as `mesh_bytes=1G,chart_points=20000`, for every
command alike. docs/limits.md holds them in a table.
"""

import os
import re
import stat
from collections.abc import Mapping
from functools import lru_cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from schemas.base.errors import RefusedInput

VARIABLE = "FOOTSCAN_LIMITS"
FACTORS = {"": 1, "k": 10**3, "M": 10**6, "G": 10**9}
LARGEST = 10**15
"""Bound of memory: no limit can be raised further, so that numbers of bytes computed from it stay sensible."""


class Limit(NamedTuple):
    """A bound of one property of input files."""

    default: int
    of_what: str
    reason: str


LIMITS: Mapping[str, Limit] = MappingProxyType(
    {
        "yaml_bytes": Limit(256_000, "bytes of a YAML document", "a scan.yaml has some 2 kB; 256 kB parse in 2 s"),
        "json_bytes": Limit(8_000_000, "bytes of a JSON document", "a calibration has some 100 kB"),
        "json_values": Limit(500_000, "values in a JSON document", "each may be a mistake that takes 1 kB to report"),
        "table_bytes": Limit(32_000_000, "bytes of a CSV file", "the stripe points of a scan have some 20 MB"),
        "table_rows": Limit(1_000_000, "lines of a CSV file", "blank ones, too, take their time"),
        "chart_points": Limit(2_000, "control points of a chart", "the thesis has 5 a camera; the work grows faster"),
        "lasts": Limit(20_000, "lasts of all tables together", "each is held beside every foot"),
        "measures": Limit(1_000, "measures of a foot", "a foot has some 30"),
        "mesh_bytes": Limit(100_000_000, "bytes of a mesh or cloud", "a foot of 200,000 triangles has 10 MB"),
        "mesh_rows": Limit(
            3_000_000, "lines, vertices, faces or corners of faces of a mesh", "each takes up to 100 bytes and 2 us"
        ),
        "polygon_corners": Limit(1_000, "corners of one face", "triangles that all meet in one point take their time"),
        "image_bytes": Limit(64_000_000, "bytes of an image", "a frame of 640 x 480 has some 30 kB"),
        "image_pixels": Limit(16_000_000, "pixels of an image", "each takes some 40 bytes as stripes are sought"),
        "film_frames": Limit(100_000, "frames of a film", "a scan has some 200"),
        "film_chunks": Limit(400_000, "chunks of an AVI file", "a frame has one, and sound may lie between"),
    }
)


class BeyondLimitError(RefusedInput):
    """An input larger than its bound. The input itself may be sound: a higher bound admits it."""

    def __reduce__(self) -> tuple[Any, ...]:
        """The parts from which another process rebuilds the error."""
        return partial(BeyondLimitError, field=self.field), (self.source, self.problem)


def limit(name: str) -> int:
    """The bound of that name: the user's own, or the default.

    Raises
    ------
    RefusedInput
        `FOOTSCAN_LIMITS` is not a list of bounds.
    """
    return _raised(os.environ.get(VARIABLE, "")).get(name, LIMITS[name].default)


def check_limits() -> None:
    """Refuse a malformed `FOOTSCAN_LIMITS` before anything is read."""
    _raised(os.environ.get(VARIABLE, ""))


def refuse_beyond(name: str, found: int, source: Path | str, *, field: str | None = None) -> None:
    """Refuse `found` if it exceeds the bound of that name.

    Raises
    ------
    BeyondLimitError
        One line that names the bound and how to raise it.
    """
    if found > limit(name):
        raise BeyondLimitError(source, beyond(name, found), field=field)


def beyond(name: str, found: int) -> str:
    """The message about a `found` that exceeds the bound of that name."""
    many = f"{found} {LIMITS[name].of_what} are too many"
    return f"{many}, expected at most {limit(name)} ({VARIABLE}={name}=N raises it)"


def read_bounded(path: Path, name: str) -> bytes:
    """The bytes of a regular file that is not larger than the bound of that name.

    The size is checked before anything is read, and a file that grows meanwhile is not read further.

    Raises
    ------
    BeyondLimitError
        It is larger.
    RefusedInput
        It is no regular file but a folder, a pipe or a device.
    OSError
        It cannot be read.
    """
    status = _stat(path)
    if not stat.S_ISREG(status.st_mode):
        raise RefusedInput(path, "expected a file")
    refuse_beyond(name, status.st_size, path)
    with path.open("rb") as file:
        content = file.read(limit(name) + 1) if status.st_size else b""
    refuse_beyond(name, len(content), path)
    return content


def _stat(path: Path) -> os.stat_result:
    try:
        return path.stat()
    except ValueError as error:  # a name that no file can have
        raise RefusedInput(path, f"cannot be read ({error})") from None


@lru_cache(maxsize=8)
def _raised(text: str) -> Mapping[str, int]:
    """The bounds that `text` names."""
    bounds: dict[str, int] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, _, value = (word.strip() for word in part.partition("="))
        if name not in LIMITS:
            raise RefusedInput(VARIABLE, f"unknown limit {name[:80]!r}, expected one of {', '.join(LIMITS)}")
        number = re.fullmatch(r"([0-9]{1,18})([kMG]?)", value)
        bound = int(number[1]) * FACTORS[number[2]] if number else 0
        if not 0 < bound <= LARGEST:
            raise RefusedInput(
                VARIABLE, f"expected a whole number such as 20000 or 2G, found {value[:80]!r}", field=name
            )
        bounds[name] = bound
    return bounds
