"""The glass plate that the foot stands on: refraction through it and reflection from its faces.

The plate lies between Z = -`THICKNESS_MM` and Z = 0, the face that the foot stands on.
"""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Floats = NDArray[np.float64]

THICKNESS_MM = 6.0
"""Chosen by hand."""
REFRACTIVE_INDEX = 1.52
"""Of soda-lime glass in visible light."""
_NEWTON_STEPS = 8
"""Chosen by hand."""


def sine_from_below(source: Floats, points: Floats, passes: int = 1, thickness: float = THICKNESS_MM) -> Floats:
    """Sine of the angle to the vertical at which light runs in air between `source` below the plate and `points` above.

    With s that sine, h the heights in air and t the path in glass, the horizontal distance is
    r = h s / sqrt(1 - s^2) + t s / sqrt(n^2 - s^2), by Snell's law at plane-parallel faces. It is solved for
    s / sqrt(1 - s^2) by Newton's method, whose steps converge from the left since r is concave in it.

    Parameters
    ----------
    source : (3,) float64, mm; below the plate.
    points : (N, 3) float64, mm; Z below 0 is taken as 0.
    passes : number of crossings of the plate; 3 with one reflection at each of its faces.
    thickness : of the plate, mm.

    Returns
    -------
    (N,) float64, 0 <= s < 1.
    """
    return _sines(np.ascontiguousarray(source), np.ascontiguousarray(points), passes * thickness, thickness)


@compiled
def _sines(source: Floats, points: Floats, glass: float, thickness: float) -> Floats:
    n2 = REFRACTIVE_INDEX**2
    sines = np.empty(len(points))
    for k in range(len(points)):
        x, y = points[k, 0] - source[0], points[k, 1] - source[1]
        distance = np.sqrt(x * x + y * y)
        air = max(points[k, 2], 0.0) - thickness - source[2]
        tangent = distance / (air + glass)
        for _ in range(_NEWTON_STEPS):
            # In glass: s / sqrt(n^2 - s^2) with s^2 = q^2 / (1 + q^2) is q / sqrt(n^2 + (n^2 - 1) q^2).
            root = np.sqrt(n2 + (n2 - 1.0) * (tangent * tangent))
            excess = air * tangent + glass * tangent / root - distance
            before, tangent = tangent, tangent - excess / (air + glass * n2 / (root * root * root))
            if tangent == before:
                break
        sines[k] = tangent / np.sqrt(1.0 + tangent * tangent)
    return sines


def directions_from_below(source: Floats, points: Floats, passes: int = 1, thickness: float = THICKNESS_MM) -> Floats:
    """Returns unit directions (N, 3) in which light leaves `source` below the plate to arrive at `points` above it."""
    sine = sine_from_below(source, points, passes, thickness)
    offset = points[:, :2] - source[:2]
    distance = np.maximum(np.sqrt(offset[:, 0] ** 2 + offset[:, 1] ** 2), 1e-12)
    return np.column_stack([offset * (sine / distance)[:, None], np.sqrt(1.0 - sine**2)])


def exits_above(source: Floats, directions: Floats, passes: int = 1, thickness: float = THICKNESS_MM) -> Floats:
    """Returns the points (N, 3), mm, Z = 0, where rays from `source` below the plate leave its upper face.

    A plane-parallel plate does not change the directions of rays.
    """
    sine = np.sqrt(directions[:, 0] ** 2 + directions[:, 1] ** 2)
    rise = directions[:, 2]
    # Horizontal way for each unit of sine: in air h / cos, in glass t / (n cos') with n cos' = sqrt(n^2 - s^2).
    way = (-thickness - source[2]) / rise + passes * thickness / np.sqrt(REFRACTIVE_INDEX**2 - sine**2)
    exits = np.zeros_like(directions)
    exits[:, :2] = source[:2] + directions[:, :2] * way[:, None]
    return exits


def reflectance(cosine: Floats) -> Floats:
    """Share of unpolarised light that one face reflects (Fresnel); `cosine` of the angle of incidence in air."""
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / REFRACTIVE_INDEX**2)
    across = (cosine - REFRACTIVE_INDEX * inside) / (cosine + REFRACTIVE_INDEX * inside)
    along = (REFRACTIVE_INDEX * cosine - inside) / (REFRACTIVE_INDEX * cosine + inside)
    return np.asarray((across**2 + along**2) / 2.0)
