"""From the errors of a surface to those of its measures."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.measure.quantity import Quantity
from footscan.measure.replicates import ErrorField
from footscan.rows import distinct_rows

WIDE_MM = 60.0
"""Distance over which errors of whole cameras and heads vary on the foot. Chosen by hand."""
FEWEST_REPLICATES = 5
"""Replicates that must have a measure for a standard deviation."""

Floats = NDArray[np.float64]


class SurfaceErrors:
    """Errors of the vertices of a foot.

    Parameters
    ----------
    vertices : (V, 3) mm
    errors_mm : (V,) standard deviations, mm
    reach_mm : vertices in the same cube of this edge share their error; 0: independent errors
    wide_mm : standard deviation of a further error, which vertices share over `WIDE_MM`
    """

    def __init__(self, vertices: Floats, errors_mm: Floats, reach_mm: float, wide_mm: float) -> None:
        self.fields = [
            ErrorField(deviations, reach)
            for deviations, reach in ((errors_mm, reach_mm), (np.full(len(vertices), wide_mm), WIDE_MM))
            if deviations.any()
        ]
        self._patches = [_cubes(vertices, field.reach_mm) for field in self.fields]

    def linear_sd(self, quantity: Quantity) -> float | None:
        """Standard deviation of a quantity by linear propagation; None where its derivatives are not known."""
        parts = [quantity.sd(field.deviations, patch) for field, patch in zip(self.fields, self._patches, strict=True)]
        known = [part for part in parts if part is not None]
        return math.hypot(*known) if len(known) == len(parts) else None


def _cubes(vertices: Floats, edge: float) -> NDArray[np.int64] | None:
    """Return (V,) the number of the cube in which each vertex lies; None without cubes."""
    return distinct_rows(np.floor(vertices / edge)).number if edge > 0 else None


class Scatter(NamedTuple):
    """How far a measure scatters over the replicates of a foot."""

    sd: float
    missing: float
    """Share of the replicates that do not have it."""


def scatter_of(values: Sequence[Mapping[str, float]], count: int) -> dict[str, Scatter]:
    """The scatter of each measure, if enough of `count` replicates have it.

    The standard deviation is that of the t distribution of a value whose variance is estimated from few (JCGM 101:2008,
    6.4.9).

    >>> scatter = scatter_of([{"foot_length": 250.0 + 0.1 * k} for k in range(9)], count=10)["foot_length"]
    >>> print(f"{scatter.sd:.2f} mm; {scatter.missing:.1f} of the replicates do not have it")
    0.32 mm; 0.1 of the replicates do not have it
    """
    found: dict[str, list[float]] = {}
    for of_one in values:
        for name, value in of_one.items():
            found.setdefault(name, []).append(value)
    return {
        name: Scatter(float(np.std(each, ddof=1)) * math.sqrt((len(each) - 1) / (len(each) - 3)), 1 - len(each) / count)
        for name, each in found.items()
        if len(each) >= FEWEST_REPLICATES
    }
