"""What a map is fitted to: pixels, and for each the line of the laser's plane on which its world point lies.

A control point is two observations, its Y and its Z; a pixel of the stripe over a known edge is one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Observations:
    """Of one camera. The world point (Y, Z) of pixel k satisfies normal . (Y, Z) = offset."""

    pixels: Floats
    """(N, 2), px."""
    normals: Floats
    """(N, 2), unit."""
    offsets: Floats
    """(N,), mm."""
    point: NDArray[np.intp]
    """(N,) observations of one point share a number: their errors add up to one distance."""
    block: NDArray[np.intp]
    """(N,) what errs together shares a number, and counts as much as one observation: neighbours along the stripe."""
    group: NDArray[np.intp]
    """(N,) what is held out together shares a number; blocks do not straddle groups."""

    def __len__(self) -> int:
        return len(self.offsets)

    @property
    def independent(self) -> int:
        """How many observations there are whose errors have nothing to do with each other."""
        return len(np.unique(self.block))

    @property
    def points(self) -> int:
        """How many points they tell of."""
        return len(np.unique(self.point))

    @property
    def share(self) -> Floats:
        """The weight (N,) of each in its block: all of a block count as one."""
        _, number, count = np.unique(self.block, return_inverse=True, return_counts=True)
        return np.asarray(1.0 / count[number])

    def across(self, world: Floats) -> Floats:
        """Residuals (N,), mm, where the pixels are mapped to `world` (N, 2)."""
        return np.asarray(np.einsum("nk,nk->n", self.normals, world) - self.offsets)

    def part(self, chosen: NDArray[np.bool_]) -> "Observations":
        """Those that are chosen, (N,)."""
        return Observations(
            self.pixels[chosen], self.normals[chosen], self.offsets[chosen],
            self.point[chosen], self.block[chosen], self.group[chosen],
        )  # fmt: skip

    def sorted(self) -> "Observations":
        """In an order of their own, so that a fit does not depend on the order in which they came.

        Blocks are numbered anew in that order.
        """
        keys = np.column_stack([self.pixels, self.normals, self.offsets])
        order = np.lexsort(keys.T[::-1])
        _, first, block = np.unique(self.block[order], return_index=True, return_inverse=True)
        return Observations(
            self.pixels[order], self.normals[order], self.offsets[order],
            self.point[order], np.argsort(np.argsort(first))[block], self.group[order],
        )  # fmt: skip

    def distances(self, residuals: Floats) -> Floats:
        """Distance of each point, in the order of their numbers, from `residuals` (N,) of the observations."""
        _, number = np.unique(self.point, return_inverse=True)
        return np.asarray(np.sqrt(np.bincount(number, residuals**2)))

    def errors(self, residuals: Floats) -> tuple[Floats, Floats]:
        """Where in the image the `residuals` (N,) leave what error: pixels (M, 2) and Y and Z (M, 2), mm.

        There is one for each control point, and one for each block of pixels on an edge, across it: along the edge
        nothing is known.
        """
        first = np.full(self.point.max(initial=-1) + 1, np.iinfo(np.intp).max)
        np.minimum.at(first, self.point, self.block)  # the two blocks of a control point have one place
        _, place, count = np.unique(first[self.point], return_inverse=True, return_counts=True)

        def summed(values: Floats) -> Floats:
            return np.stack([np.bincount(place, column) for column in values.T], axis=-1)

        outer = self.normals[:, :, np.newaxis] * self.normals[:, np.newaxis, :]
        normal = summed(outer.reshape(-1, 4)).reshape(-1, 2, 2)
        right = summed(self.normals * residuals[:, np.newaxis])
        errors = np.linalg.pinv(normal, rcond=1e-6, hermitian=True) @ right[:, :, np.newaxis]
        return summed(self.pixels) / count[:, np.newaxis], errors[:, :, 0]


def of_points(pixels: Floats, world: Floats, group: NDArray[np.intp]) -> Observations:
    """Control points: `pixels` (N, 2), their `world` (N, 2) Y and Z in mm, and the `group` (N,) of each."""
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
