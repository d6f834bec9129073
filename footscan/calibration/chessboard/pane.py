"""A pane of glass between a camera and what it sees: rays behind it are parallel to those before it, but displaced.

By Snell's law at plane-parallel faces, what lies behind a pane of thickness t and refractive index n is seen nearer by
t (1 - cos a / sqrt(n^2 - sin^2 a)) along the pane's normal, with a the angle between that and the ray. Where the pane
stands does not matter, but a ray's displacement depends on its direction: no pinhole sees so.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chessboard.pinhole import Pinhole

Floats = NDArray[np.float64]

STEPS = 20
"""Fixed-point steps to the direction in which a point is seen; the error falls more than tenfold with each."""


@dataclass(frozen=True)
class Pane:
    """A pane in the camera's frame."""

    thickness_mm: float
    index: float
    normal: Floats
    """(3,), unit, away from the camera."""

    def shift(self, directions: Floats) -> Floats:
        """How much nearer things are seen along `directions` (N, 3), of any length: (N, 3) mm, along the normal.

        >>> pane = Pane(6.0, 1.5, np.array([0.0, 0.0, 1.0]))
        >>> print(pane.shift(np.array([[0.0, 0.0, 2.0]])))
        [[0. 0. 2.]]
        """
        cosine = directions @ self.normal / np.linalg.norm(directions, axis=1)
        way = self.thickness_mm * (1.0 - cosine / np.sqrt(self.index**2 - 1.0 + cosine**2))
        return np.asarray(way[:, np.newaxis] * self.normal)

    def apparent(self, points: Floats) -> Floats:
        """Where `points` (N, 3), mm, camera frame, behind the pane are seen, (N, 3) mm."""
        seen = points
        for _ in range(STEPS):
            seen = points - self.shift(seen)
        return seen


@dataclass(frozen=True)
class Sight:
    """A pinhole, perhaps behind a pane."""

    pinhole: Pinhole
    pane: Pane | None = None

    def rays(self, pixels: Floats) -> tuple[Floats, Floats]:
        """Origins, mm, and directions, (N, 3), camera frame, of what is seen at `pixels` (N, 2) behind the pane."""
        directions = self.pinhole.directions(pixels)
        return np.zeros_like(directions) if self.pane is None else self.pane.shift(directions), directions

    def apparent(self, points: Floats) -> Floats:
        """Where `points` (N, 3), mm, camera frame, are seen; without a pane they themselves."""
        return points if self.pane is None else self.pane.apparent(points)
