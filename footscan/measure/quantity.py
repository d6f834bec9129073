"""Numbers measured on a mesh, with their derivatives by the displacements of its vertices."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from footscan.compiled import compiled

Floats = NDArray[np.float64]


class NotMeasurable(Exception):
    """Raised where a measure cannot be taken; the message names what is missing and becomes the note of the measure."""


class Quantity(NamedTuple):
    """A value and its derivatives, which propagate the errors of the mesh to every measure.

    Independent errors of standard deviations sd, (V,), at the vertices give the value the standard deviation
    sqrt(sum (gradient * sd)^2): first-order propagation, JCGM 100:2008, 5.1.2.
    """

    value: float
    gradient: Floats
    """(V,) change of the value per mm of each vertex's displacement outwards; NaN where unknown"""
    doubt: str | None = None
    """Why the value is uncertain; None if it is not."""
    surface_length: float | None = None
    """Length along the skin, mm; only of a girth."""
    note: str | None = None
    """A remark for the reader of the measure."""
    plane: tuple[Floats, Floats] | None = None
    """Plane of a girth: a point (3,) mm and its normal (3,), in the foot's frame."""

    def sd(self, errors: Floats, shares: csr_array | None = None) -> float | None:
        """Standard deviation of the value; None where it is unknown.

        Parameters
        ----------
        errors : (V,) standard deviations of the vertices, mm
        shares : (V, N) of N independent errors in the error of each vertex; default: each has its own

        Examples
        --------
        Independent errors of 0.3 and 0.4 mm at two vertices, or one error that both share:

        >>> difference = Quantity(10.0, np.array([1.0, -1.0]))
        >>> difference.sd(np.array([0.3, 0.4]))
        0.5
        >>> difference.sd(np.array([0.3, 0.3]), csr_array([[1.0], [1.0]]))
        0.0
        """
        moves = (
            self.gradient * errors
            if shares is None
            else _moves_of_shared(self.gradient, errors, shares.data, shares.indices, shares.indptr, shares.shape[1])
        )
        deviation = float(np.sqrt(np.sum(moves**2)))
        return deviation if np.isfinite(deviation) else None

    def share(self, of: NDArray[np.bool_]) -> float:
        """Share of the variance, 0 to 1, that comes from the vertices `of`, (V,), if all have the same error."""
        weight = np.nan_to_num(self.gradient) ** 2
        total = float(weight.sum())
        return float(weight[of].sum()) / total if total > 0 else 0.0

    def by_lift(self, normals: Floats) -> float | None:
        """Change of the value, regardless of its sign, per mm by which the foot of `normals`, (V, 3), stands higher.

        None where it is unknown.
        """
        change = abs(float(self.gradient @ normals[:, 2]))
        return change if np.isfinite(change) else None

    def minus(self, other: Self) -> "Quantity":
        """The difference of two quantities, with the doubts of both."""
        doubts = [doubt for doubt in (self.doubt, other.doubt) if doubt is not None]
        gradient = self.gradient - other.gradient
        return Quantity(self.value - other.value, gradient, "; ".join(dict.fromkeys(doubts)) or None)


@compiled
def _moves_of_shared(
    gradient: Floats,
    errors: Floats,
    shares: Floats,
    shared: NDArray[np.integer],
    starts: NDArray[np.integer],
    count: int,
) -> Floats:
    """Returns (count,) the moves of the errors that (V,) vertices share, from the rows of a sparse (V, count) matrix.

    A measure rests on few vertices: most moves are 0.
    """
    total = np.zeros(count)
    for vertex in range(len(gradient)):
        if gradient[vertex] != 0.0:
            move = gradient[vertex] * errors[vertex]
            for k in range(starts[vertex], starts[vertex + 1]):
                total[shared[k]] += move * shares[k]
    return total


def combined(value: float, *terms: tuple[float, Quantity]) -> Quantity:
    """A quantity with the gradient of the sum of factor times quantity, and the doubts of all terms.

    Examples
    --------
    The mean of two quantities:

    >>> first, second = Quantity(1.0, np.array([1.0, 0.0])), Quantity(3.0, np.array([0.0, 1.0]), "fallback")
    >>> mean = combined(2.0, (0.5, first), (0.5, second))
    >>> mean.gradient.tolist(), mean.doubt
    ([0.5, 0.5], 'fallback')
    """
    gradient: Floats = np.sum([factor * quantity.gradient for factor, quantity in terms], axis=0)
    doubts = [quantity.doubt for _, quantity in terms if quantity.doubt is not None]
    return Quantity(value, gradient, "; ".join(dict.fromkeys(doubts)) or None)
