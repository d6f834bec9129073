"""Stripes of another laser on the cap of a heel, whose form says in which of two planes a stripe lies.

Where lasers first meet a heel, their stripes are narrow rings that grow by millimetres while the rows of a picture are
exposed. Cameras that see the ring of another laser hardly agree on it in any plane, and by chance in their own one.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.outliers.contested import LEG_MM
from footscan.robust import MAD_TO_SD, tukey_weights

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

FIT_MM, JUDGED_MM = 8.0, 4.0
"""Part of an end to which the cap is fitted, and the part in which stripes are judged. Chosen by hand."""
FEWEST, STRAYS = 200, 20
"""Points that make a cap, and points beyond an end that may be strays. Chosen by hand."""
ORDER, UNIT_MM = 4, 20.0
"""Order of the polynomial, and the unit of its variables: about the radius of the cap."""
FITS = 8
"""Fits of the polynomial, each with the weights that follow from the one before: a bound of time."""
LEAST_MISFIT_MM, MOST_MISFIT_MM = 0.03, 0.15
"""Standard deviation of points about the cap at least, and at most: several toes are no cap. The heels of 12 scanners
without pictures (`draw_assembled`, seeds 5791, 6153, 6159, 6197 and 7001 to 7008) have 0.10 to 0.14 mm, their toes 0.33
to 1.21 mm; the heel of a model of real feet has 0.090 mm, its toes 0.154 mm."""
OFF_MM = 0.2
"""Distance along X from which a stripe is off the cap. Tuned on the first four of these scanners: others' stripes there
were off by 0.22 mm and more, own ones by 0.16 mm and less. On the other eight, 45 points were selected that were off by
more than 0.5 mm, and 12 right ones."""
ROUNDS = 2
"""The cap is fitted again without the stripes that are off it: a bound of time."""


class Cap(NamedTuple):
    """X of the skin at an end of the foot as a polynomial of Y and Z."""

    middle: Floats
    """(2,) mm"""
    factors: Floats

    def away(self, xyz: Floats) -> Floats:
        """Distances (N,) of places (N, 3) along X, mm."""
        return np.asarray(xyz[:, 0] - _terms(xyz[:, 1:], self.middle) @ self.factors)


def is_off_cap(xyz: Floats, kept: Mask, stripe: Ints, places: Floats) -> Mask:
    """Select the stripes that are off the cap of a heel, and would be nearer to it in the plane of another laser.

    Parameters
    ----------
    xyz : (N, 3) mm, scanner frame
    kept : (N,) points that make the cap, and are judged
    stripe : (N,) number of the stripe of each point
    places : (H, N, 3) mm, of each point in the plane of each laser; NaN where it is not known
    """
    selected = np.zeros(len(xyz), np.bool_)
    for outward in (-1.0, 1.0):
        for _ in range(ROUNDS):
            left = np.flatnonzero(kept & ~selected & (xyz[:, 2] < LEG_MM))
            if len(left) < FEWEST:
                break
            depth = np.sort(outward * xyz[left, 0])[-STRAYS] - outward * xyz[left, 0]
            cap = _fitted(xyz[left[depth < FIT_MM]])
            if cap is None:
                break
            judged = left[depth < JUDGED_MM]
            off = _is_nearer_elsewhere(cap, xyz[judged], stripe[judged], places[:, judged])
            if not off.any():
                break
            selected[judged[off]] = True
    return selected


def _fitted(skin: Floats) -> Cap | None:
    """The cap of an end with points (N, 3), mm; None if they make none."""
    if len(skin) < FEWEST:
        return None
    middle: Floats = np.median(skin[:, 1:], axis=0)
    terms = _terms(skin[:, 1:], middle)
    factors: Floats = np.zeros(0)
    weights: Floats = np.ones(len(skin))
    misfit = np.inf
    for _ in range(FITS):
        root = np.sqrt(weights)
        factors = np.asarray(np.linalg.lstsq(terms * root[:, None], skin[:, 0] * root)[0], np.float64)
        away = skin[:, 0] - terms @ factors
        misfit = MAD_TO_SD * float(np.median(np.abs(away)))
        weights = tukey_weights(away / max(misfit, LEAST_MISFIT_MM))
    return Cap(middle, factors) if misfit < MOST_MISFIT_MM else None


def _terms(yz: Floats, middle: Floats) -> Floats:
    """The terms of the polynomial at N places, (N, 15)."""
    y, z = ((yz - middle) / UNIT_MM).T
    powers = np.arange(ORDER + 1)
    terms = np.polynomial.polynomial.polyvander2d(y, z, (ORDER, ORDER))
    return np.asarray(terms[:, np.add.outer(powers, powers).ravel() <= ORDER])


def _is_nearer_elsewhere(cap: Cap, xyz: Floats, stripe: Ints, places: Floats) -> Mask:
    """Select the stripes with points (N, 3) that are off a cap, and nearer to it at one of their `places` (H, N, 3)."""
    away, elsewhere = cap.away(xyz), np.array([cap.away(place) for place in places])
    selected = np.zeros(len(xyz), np.bool_)
    for number in np.unique(stripe):
        rows = stripe == number
        here = abs(np.median(away[rows]))
        selected[rows] = here > OFF_MM and np.any(np.abs(np.median(elsewhere[:, rows], axis=1)) < here)
    return selected
