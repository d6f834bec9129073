"""The plane of the laser's light, from points of stripes on boards."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chessboard.pinhole import Pose
from footscan.robust import MAD_TO_SD, TUKEY

Floats = NDArray[np.float64]

ROUNDS = 8
"""How often the weights of outliers are updated: a bound of time."""
LEAST_SD_MM = 0.01
"""Lower bound of the scale of the distances, so that exact points have no outliers. Chosen by hand."""
LEAST_SPREAD_MM = 3.0
"""Standard deviation of the points in the plane, across their longest direction, that a plane needs. Chosen by hand."""
LEAST_COSINE = 0.7
"""Of the angle between the plane's normal and the travel: 45 degrees. A wrong place of the board turns it by more."""


class UndeterminedPlaneError(Exception):
    """The stripes do not determine a plane."""


@dataclass(frozen=True)
class Plane:
    """The points p with normal . p = distance."""

    normal: Floats
    """(3,), unit."""
    distance: float
    """mm."""

    def meet(self, origins: Floats, directions: Floats) -> Floats:
        """Where rays from `origins` (N, 3), mm, along `directions` (N, 3) meet the plane, (N, 3) mm; NaN behind."""
        depth = (self.distance - origins @ self.normal) / (directions @ self.normal)
        return origins + directions * np.where(depth > 0.0, depth, np.nan)[:, np.newaxis]

    def seen_from(self, frame: Pose) -> "Plane":
        """The same plane in the frame that `frame` leads from to this one.

        >>> moved = Plane(np.array([1.0, 0, 0]), 5.0).seen_from(Pose(np.eye(3), np.array([2.0, 0, 0])))
        >>> print(moved.normal, moved.distance)
        [1. 0. 0.] 3.0
        """
        return Plane(self.normal @ frame.rotation, self.distance - float(self.normal @ frame.translation))


def fit_plane(stripes: Sequence[Floats]) -> tuple[Plane, Floats]:
    """Fit a plane to stripes, each of equal weight, by the least squares of distances, with Tukey's biweight.

    Parameters
    ----------
    stripes : (N, 3) mm each.

    Returns
    -------
    The plane, and the mean distance (S,) of each stripe from it, mm.

    Raises
    ------
    UndeterminedPlaneError
        There is one stripe, or all points lie nearly on one line.
    """
    if len(stripes) < 2:
        raise UndeterminedPlaneError(f"the stripe was found on {len(stripes)} boards, expected at least 2")
    points = np.concatenate(stripes)
    stripe = np.repeat(np.arange(len(stripes)), [len(part) for part in stripes])
    share = 1.0 / np.bincount(stripe)[stripe]
    weights = share
    for _ in range(ROUNDS):
        middle = weights @ points / weights.sum()
        rest = points - middle
        spreads, axes = np.linalg.eigh(np.einsum("n,np,nq->pq", weights, rest, rest) / weights.sum())
        distances = rest @ axes[:, 0]
        sd = max(MAD_TO_SD * float(np.median(np.abs(distances))), LEAST_SD_MM)
        weights = share * (1.0 - np.clip((distances / (TUKEY * sd)) ** 2, None, 1.0)) ** 2
    if np.sqrt(max(spreads[1], 0.0)) < LEAST_SPREAD_MM:
        raise UndeterminedPlaneError(
            "the stripes lie nearly on one line, expected boards nearer to the camera and farther off"
        )
    normal = axes[:, 0]
    means = np.array([distances[stripe == number].mean() for number in range(len(stripes))])
    return Plane(normal, float(normal @ middle)), means


def across_travel(plane: Plane, z_mm: float) -> tuple[float, float, float]:
    """X of a plane of the scanner's frame at Y = 0 and Z = `z_mm`, mm, and its slopes in Y and Z, mm per mm.

    Raises
    ------
    UndeterminedPlaneError
        The plane lies rather along the travel than across it.

    Examples
    --------
    >>> x, yaw, pitch = across_travel(Plane(np.array([0.8, -0.6, 0.0]), 1.6), 57.0)
    >>> print(round(x, 6), round(yaw, 6), round(abs(pitch), 6))
    2.0 0.75 0.0
    """
    nx, ny, nz = plane.normal
    if abs(nx) < LEAST_COSINE:
        turned = float(np.degrees(np.arccos(abs(nx))))
        raise UndeterminedPlaneError(
            f"the laser plane would be turned by {turned:.0f} degrees from across the travel: expected a place of the "
            "board in the scanner's frame"
        )
    return (plane.distance - z_mm * nz) / nx, -ny / nx, -nz / nx
