"""A number measured on a mesh, and how it follows the errors of the vertices."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class NotThere(Exception):
    """What a measure needs cannot be had; says what, for the note of the measure."""


class Quantity(NamedTuple):
    """A value and its derivatives, which carry the errors of the mesh through to every measure.

    Independent errors of (V,) standard deviations sd at the vertices give the value one of sqrt(sum (gradient * sd)^2):
    first-order propagation, JCGM 100:2008, 5.1.2.
    """

    value: float
    gradient: Floats
    """(V,) change of the value by each vertex's displacement outwards, per mm; NaN where that is not known."""
    doubt: str | None = None
    """Why the value is uncertain, where it is."""
    surface_length: float | None = None
    """Of a girth, along the surface, mm."""
    note: str | None = None
    """What else is worth knowing of it."""
    plane: tuple[Floats, Floats] | None = None
    """Of a girth, a point (3,) mm and the normal (3,) of its plane, in the foot's frame."""

    def sd(self, errors: Floats, patch: NDArray[np.int64] | None = None) -> float | None:
        """Standard deviation by the (V,) standard deviations of the vertices; None where it is not known. Vertices are
        independent of each other, or share their error with others of the same (V,) `patch`."""
        moves = self.gradient * errors
        if patch is not None:
            moves = np.bincount(patch, moves).astype(np.float64)
        deviation = float(np.sqrt(np.sum(moves**2)))
        return deviation if np.isfinite(deviation) else None

    def share(self, of: NDArray[np.bool_]) -> float:
        """How far the value rests on those of the (V,) vertices: their part, 0 to 1, of its variance where all have the
        same error."""
        weight = np.nan_to_num(self.gradient) ** 2
        total = float(weight.sum())
        return float(weight[of].sum()) / total if total > 0 else 0.0

    def minus(self, other: Self) -> "Quantity":
        """The difference to another one, with the doubts of both."""
        doubts = [doubt for doubt in (self.doubt, other.doubt) if doubt is not None]
        gradient = self.gradient - other.gradient
        return Quantity(self.value - other.value, gradient, "; ".join(dict.fromkeys(doubts)) or None)


def combined(value: float, *terms: tuple[float, Quantity]) -> Quantity:
    """`value` with the gradient of the sum of factor times quantity, and the doubts of all."""
    gradient: Floats = np.sum([factor * quantity.gradient for factor, quantity in terms], axis=0)
    doubts = [quantity.doubt for _, quantity in terms if quantity.doubt is not None]
    return Quantity(value, gradient, "; ".join(dict.fromkeys(doubts)) or None)
