"""Uneven colour of a surface: a smooth random field in space, so that it stays where it is while the heads travel."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.virtual.portable import gaussian_blur

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

SPACING_MM = 1.5
"""Distance of the grid's points. Chosen by hand."""
_CELLS = 80
"""Points of the grid along each axis: the field repeats after 120 mm and takes 2 MB."""


class Reflectance(Protocol):
    """How much light the places of a surface reflect."""

    def at(self, points: Floats) -> Floats:
        """Factor of brightness, (N,), at `points` (N, 3) mm, scanner frame."""


@dataclass(frozen=True)
class Texture:
    """A field on a grid of cells, repeated in all directions, linear between the grid's points; 1 on average."""

    field: Singles
    """(80, 80, 80) factors of brightness."""

    def at(self, points: Floats) -> Floats:
        """Factor of brightness, (N,), at `points` (N, 3) mm, scanner frame."""
        return np.asarray(_interpolated(points, self.field))


def random_texture(seed: int, unevenness: float) -> Texture:
    """Draw a texture with standard deviation `unevenness`: grain of some millimetres on patches of 1 to 2 cm."""
    random = np.random.default_rng([seed, 3])
    field = np.zeros((_CELLS, _CELLS, _CELLS), dtype=np.float32)
    for sigma in (1.0, 6.0):
        octave = gaussian_blur(random.standard_normal(field.shape, dtype=np.float32), sigma, mode="wrap")
        field += octave / octave.std()
    return Texture(np.maximum(1.0 + unevenness / np.sqrt(2.0) * field, 0.2).astype(np.float32))


@compiled
def _interpolated(points: Floats, field: Singles) -> Floats:
    cells = field.shape[0]
    factors = np.empty(len(points))
    for n in range(len(points)):
        x, y, z = points[n, 0] / SPACING_MM, points[n, 1] / SPACING_MM, points[n, 2] / SPACING_MM
        a, b, c = int(np.floor(x)), int(np.floor(y)), int(np.floor(z))
        x, y, z = x - a, y - b, z - c
        total = 0.0
        for p in range(2):
            for q in range(2):
                for r in range(2):
                    share = (x if p else 1.0 - x) * (y if q else 1.0 - y) * (z if r else 1.0 - z)
                    total += share * field[(a + p) % cells, (b + q) % cells, (c + r) % cells]
        factors[n] = total
    return factors
