"""The printed chessboard: its squares, its pose, and how much light its places reflect."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.virtual.optics.scene import Mesh

Floats = NDArray[np.float64]

WHITE, BLACK = 0.85, 0.06
"""Reflectance of paper and of toner. Chosen by hand."""


@dataclass(frozen=True)
class PrintedBoard:
    """A chessboard in a pose.

    In the board's frame x runs along from the first inner corner, y down, and z away from the viewer.
    """

    squares: tuple[int, int]
    """Along and down; both corner squares on the left are black."""
    square_mm: float
    margin_mm: float
    """Width of the white border."""
    origin: Floats
    """(3,) mm, the first inner corner."""
    axes: Floats
    """(3, 3), orthonormal; the rows are x, y and z of the board."""

    def moved(self, origin: Floats, axes: Floats) -> "PrintedBoard":
        """The same board in another pose."""
        return PrintedBoard(self.squares, self.square_mm, self.margin_mm, origin, axes)

    @property
    def outline(self) -> Floats:
        """(4, 3) mm, the corners of the paper: upper left, upper right, lower right, lower left."""
        low = -self.square_mm - self.margin_mm
        right, bottom = (self.square_mm * (count - 1) + self.margin_mm for count in self.squares)
        flat = np.array([[low, low], [right, low], [right, bottom], [low, bottom]])
        return np.asarray(self.origin + flat @ self.axes[:2])

    @property
    def mesh(self) -> Mesh:
        """The paper's face towards the viewer."""
        return Mesh(self.outline, np.array([[0, 2, 1], [0, 3, 2]]))

    @property
    def corners(self) -> Floats:
        """(N, 3) mm, the inner corners, row by row."""
        columns, rows = (count - 1 for count in self.squares)
        y, x = np.mgrid[0:rows, 0:columns]
        flat = self.square_mm * np.column_stack([x.ravel(), y.ravel()])
        return np.asarray(self.origin + flat @ self.axes[:2])

    def at(self, points: Floats) -> Floats:
        """Reflectance (N,) at `points` (N, 3), mm, on the board; 0 beside it."""
        x, y = ((points - self.origin) @ self.axes[:2].T).T
        column, row = np.floor(x / self.square_mm) + 1.0, np.floor(y / self.square_mm) + 1.0
        on_squares = (column >= 0) & (column < self.squares[0]) & (row >= 0) & (row < self.squares[1])
        black = on_squares & ((column + row) % 2 == 0)
        low = -self.square_mm - self.margin_mm
        right, bottom = (self.square_mm * (count - 1) + self.margin_mm for count in self.squares)
        on_paper = (x >= low) & (x <= right) & (y >= low) & (y <= bottom)
        return np.where(on_paper, np.where(black, BLACK, WHITE), 0.0)
