"""Observations to which a map is fitted: pixels, each with the line of the laser plane on which its world point lies.

A control point gives two observations, its Y and its Z; a pixel of the stripe on a known edge gives one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Observations:
    """The observations of one camera. The world point (Y, Z) of each pixel satisfies normal . (Y, Z) = offset."""

    pixels: Floats
    """(N, 2), px."""
    normals: Floats
    """(N, 2), unit."""
    offsets: Floats
    """(N,), mm."""
    point: NDArray[np.intp]
    """(N,) number of the point; the errors of its observations add up to one distance."""
    block: NDArray[np.intp]
    """(N,) number of the block. Observations with correlated errors, as of neighbours along the stripe, form a block,
    which counts as one observation."""
    group: NDArray[np.intp]
    """(N,) number of the group. Observations of one group are held out together; a block lies in one group."""

    def __len__(self) -> int:
        return len(self.offsets)

    @property
    def independent(self) -> int:
        """Number of independent observations: that of the blocks."""
        return len(np.unique(self.block))

    @property
    def points(self) -> int:
        """Number of points."""
        return len(np.unique(self.point))

    @property
    def share(self) -> Floats:
        """The weights (N,) of the observations; those of a block add up to 1."""
        _, number, count = np.unique(self.block, return_inverse=True, return_counts=True)
        return np.asarray(1.0 / count[number])

    def across(self, world: Floats) -> Floats:
        """Residuals (N,), mm, if the pixels are mapped to `world` (N, 2)."""
        return np.asarray(np.einsum("nk,nk->n", self.normals, world) - self.offsets)

    def part(self, chosen: NDArray[np.bool_]) -> "Observations":
        """The observations selected by `chosen` (N,)."""
        return Observations(
            self.pixels[chosen], self.normals[chosen], self.offsets[chosen],
            self.point[chosen], self.block[chosen], self.group[chosen],
        )  # fmt: skip

    def sorted(self) -> "Observations":
        """The observations sorted by their values, so that a fit does not depend on the order of the input.

        Blocks are renumbered in that order.
        """
        keys = np.column_stack([self.pixels, self.normals, self.offsets])
        order = np.lexsort(keys.T[::-1])
        _, first, block = np.unique(self.block[order], return_index=True, return_inverse=True)
        return Observations(
            self.pixels[order], self.normals[order], self.offsets[order],
            self.point[order], np.argsort(np.argsort(first))[block], self.group[order],
        )  # fmt: skip

    def distances(self, residuals: Floats) -> Floats:
        """The distance of each point, mm, by number, from the `residuals` (N,) of its observations."""
        _, number = np.unique(self.point, return_inverse=True)
        return np.asarray(np.sqrt(np.bincount(number, residuals**2)))

    def errors(self, residuals: Floats) -> tuple[Floats, Floats]:
        """The places of the `residuals` (N,) in the image: pixels (M, 2), and errors in Y and Z (M, 2), mm.

        There is one place for each control point, and one for each block of pixels on an edge. An error on an edge is
        across it, since the error along it is unknown.
        """
        first = np.full(self.point.max(initial=-1) + 1, np.iinfo(np.intp).max)
        np.minimum.at(first, self.point, self.block)  # a control point has two blocks
        _, place, count = np.unique(first[self.point], return_inverse=True, return_counts=True)

        def summed(values: Floats) -> Floats:
            return np.stack([np.bincount(place, column) for column in values.T], axis=-1)

        outer = self.normals[:, :, np.newaxis] * self.normals[:, np.newaxis, :]
        normal = summed(outer.reshape(-1, 4)).reshape(-1, 2, 2)
        right = summed(self.normals * residuals[:, np.newaxis])
        errors = np.linalg.pinv(normal, rcond=1e-6, hermitian=True) @ right[:, :, np.newaxis]
        return summed(self.pixels) / count[:, np.newaxis], errors[:, :, 0]


def of_points(pixels: Floats, world: Floats, group: NDArray[np.intp]) -> Observations:
    """Convert control points to observations.

    Parameters
    ----------
    pixels : (N, 2) float64, px.
    world : (N, 2) float64, Y and Z, mm.
    group : (N,) the points with one number are held out together.

    Examples
    --------
    >>> observations = of_points(np.array([[10.0, 20.0]]), np.array([[1.5, 2.5]]), np.array([0]))
    >>> print(len(observations), observations.points, observations.across(np.array([[1.5, 2.0], [1.5, 2.0]])))
    2 1 [ 0.  -0.5]
    """
    count = len(pixels)
    number = np.arange(count)
    return Observations(
        pixels=np.concatenate([pixels, pixels]),
        normals=np.repeat(np.eye(2), count, axis=0),
        offsets=np.concatenate([world[:, 0], world[:, 1]]),
        point=np.concatenate([number, number]),
        block=np.arange(2 * count),
        group=np.concatenate([group, group]),
    )
