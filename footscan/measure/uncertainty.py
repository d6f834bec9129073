"""From the errors of a surface to those of its measures."""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.measure.quantity import Quantity
from footscan.side_by_side import together
from footscan.surface.errors.field import ErrorField
from schemas.measures import ErrorCause

FEWEST_REPLICATES = 5
"""Replicates that must have a measure for a standard deviation."""
OF_REPLICATES = math.sqrt(0.5)
"""Movement of the landmarks of a foot relative to that of its replicates, which err twice: as the foot itself does, and
as they were displaced."""

Floats = NDArray[np.float64]


class SurfaceErrors:
    """Errors of the vertices of a foot, from independent causes.

    Parameters
    ----------
    vertices : (V, 3) mm
    fields : one a cause
    """

    def __init__(self, vertices: Floats, fields: Sequence[ErrorField]) -> None:
        self._vertex_count = len(vertices)
        self.fields = [field for field in fields if field.deviations.any()]
        # Fields by the places of the vertices have the same shares if their reach is the same.
        kinds = [(field.reach_mm, None if field.along_mm is None else n) for n, field in enumerate(self.fields)]
        distinct = dict(zip(kinds, self.fields, strict=True))
        made = together(partial(field.shares, vertices) for field in distinct.values())
        shares = dict(zip(distinct, made, strict=True))
        self._shares = [shares[kind] for kind in kinds]

    def budget(self, quantity: Quantity) -> dict[ErrorCause, float] | None:
        """Standard deviation of a quantity from each cause by linear propagation; None where its derivatives are not
        known.
        """
        parts: dict[ErrorCause, float] = {}
        for field, shares in zip(self.fields, self._shares, strict=True):
            sd = quantity.sd(field.deviations, shares)
            if sd is None:
                return None
            parts[field.cause] = math.hypot(parts.get(field.cause, 0.0), sd)
        return parts

    @property
    def counts(self) -> list[int]:
        """How many independent errors each field has."""
        return [
            len(field.deviations) if shares is None else shares.shape[1]
            for field, shares in zip(self.fields, self._shares, strict=True)
        ]

    def displacements(self, errors: Floats) -> Floats:
        """(V,) displacements along the normals, mm, by all independent `errors` (N,), in standard deviations."""
        total, end = np.zeros(self._vertex_count), 0
        for field, shares, count in zip(self.fields, self._shares, self.counts, strict=True):
            own, end = errors[end : end + count], end + count
            if shares is not None:
                own = _errors_of_vertices(own, shares.data, shares.indices, shares.indptr)
            total += field.deviations * own
        return total


@compiled
def _errors_of_vertices(
    errors: Floats, shares: Floats, shared: NDArray[np.integer], starts: NDArray[np.integer]
) -> Floats:
    """Returns (V,) the product of a sparse matrix (V, N), by rows, and (N,) `errors`; SciPy's keeps Python's lock."""
    own = np.zeros(len(starts) - 1)
    for vertex in range(len(own)):
        for k in range(starts[vertex], starts[vertex + 1]):
            own[vertex] += shares[k] * errors[shared[k]]
    return own


class Scatter(NamedTuple):
    """How far a measure scatters over the replicates of a foot."""

    mean: float
    sd: float
    missing: float
    """Share of the replicates that do not have it."""
    weight: float = OF_REPLICATES
    """Movement of the landmarks of the foot relative to that of the replicates."""

    def about(self, value: float) -> float:
        """Root mean square distance from the value of the foot itself.

        Errors make the outermost point lie farther out on average: the mean of the replicates then shows a bias, which
        the foot itself has as well.
        """
        return math.hypot(self.sd, self.mean - value)


def with_landmarks(
    budget: Mapping[ErrorCause, float] | None, scatter: Scatter | None, value: float
) -> dict[ErrorCause, float] | None:
    """Add what a measure of this value scatters by over replicates beyond its linear budget: landmarks that move.

    That counts with `Scatter.weight`; where there is no linear budget, all of the scatter counts.

    >>> with_landmarks({"noise": 0.03, "cameras": 0.04}, Scatter(mean=250.0, sd=0.13, missing=0.0), 250.0)
    {'noise': 0.03, 'cameras': 0.04, 'landmarks': 0.084852814}
    >>> with_landmarks({"noise": 0.03, "cameras": 0.04}, Scatter(mean=250.0, sd=0.02, missing=0.0), 250.0)
    {'noise': 0.03, 'cameras': 0.04}
    >>> with_landmarks(None, Scatter(mean=250.0, sd=0.13, missing=0.0), 250.0)
    {'landmarks': 0.13}
    """
    if scatter is None:
        return None if budget is None else dict(budget)
    about = scatter.about(value)
    if budget is None:
        return {"landmarks": about}
    left = about**2 - sum(sd**2 for sd in budget.values())
    return {**budget, **({"landmarks": round(scatter.weight * math.sqrt(left), 9)} if left > 0.0 else {})}


def scatter_of(values: Sequence[Mapping[str, float]], count: int, is_on_other_axis: bool = False) -> dict[str, Scatter]:
    """The scatter of each measure, if enough of `count` replicates have it.

    All of it counts where the foot is on another axis than its replicates may be: then it is mostly the turn from one
    axis to the other, by which the foot errs once.

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
        name: Scatter(
            mean=float(np.mean(each)),
            sd=float(np.std(each, ddof=1)) * math.sqrt((len(each) - 1) / (len(each) - 3)),
            missing=1 - len(each) / count,
            weight=1.0 if is_on_other_axis else OF_REPLICATES,
        )
        for name, each in found.items()
        if len(each) >= FEWEST_REPLICATES
    }
