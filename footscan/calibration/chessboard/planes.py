"""Where the laser planes of the heads lie along the travel, from those of their cameras."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chessboard.from_pictures import BoardCalibration
from schemas.calibration import LaserPlane

Floats = NDArray[np.float64]

CERTAIN = 3.0
"""A plane counts as turned or moved from so many standard deviations."""


@dataclass(frozen=True)
class HeadPlane:
    """The laser plane of a head in the scanner's frame."""

    values: Floats
    """(3,) offset from the mean of the heads, mm; yaw and pitch."""
    deviations: Floats
    """(3,) their standard deviations, with those of the placed boards."""

    @property
    def is_off(self) -> bool:
        """Whether the plane does not stand across the travel where the travel says."""
        return bool((np.abs(self.values) > CERTAIN * self.deviations).any())


def head_planes(
    calibrations: Sequence[BoardCalibration], heads: Mapping[int, int], place_sd_mm: float, diagonal_mm: float
) -> dict[int, HeadPlane]:
    """Average the planes that the cameras of each head see.

    Parameters
    ----------
    heads : camera -> head.
    place_sd_mm : standard deviation of the corners of a placed board. A board whose diagonal is `diagonal_mm` long is
        then turned by sqrt 2 of it over the diagonal; that does not average out over the cameras of a head, since all
        see the same board.

    Returns
    -------
    Head -> plane; empty if the planes of a camera are not known well enough to have standard deviations.
    """
    if not all(np.isfinite(made.sheet.deviations).all() for made in calibrations):
        return {}
    placing = place_sd_mm * np.array([1.0, np.sqrt(2.0) / diagonal_mm, np.sqrt(2.0) / diagonal_mm])
    means, deviations = {}, {}
    for head in sorted(set(heads.values())):
        own = [made for made in calibrations if heads[made.camera.camera] == head]
        weights = np.array([1.0 / np.maximum(made.sheet.deviations, 1e-9) ** 2 for made in own])
        means[head] = (weights * np.array([made.sheet.values for made in own])).sum(axis=0) / weights.sum(axis=0)
        fewest = min(made.placed for made in own)
        deviations[head] = np.sqrt(1.0 / weights.sum(axis=0) + placing**2 / fewest)
    middle = np.array([np.mean([mean[0] for mean in means.values()]), 0.0, 0.0])
    return {head: HeadPlane(means[head] - middle, deviations[head]) for head in means}


def laser_planes(planes: Mapping[int, HeadPlane], heads: Mapping[int, int]) -> dict[int, LaserPlane]:
    """The planes for the calibration file, by camera; none if no head is off.

    Otherwise the error of the placed board would turn the cloud, though the planes stand as they should.
    """
    if not any(plane.is_off for plane in planes.values()):
        return {}
    return {
        camera: LaserPlane(
            head=head,
            offset_mm=float(planes[head].values[0]),
            yaw=float(planes[head].values[1]),
            pitch=float(planes[head].values[2]),
            sd=[*(float(value) for value in planes[head].deviations), 0.0, 0.0, 0.0, 0.0],
        )
        for camera, head in heads.items()
    }
