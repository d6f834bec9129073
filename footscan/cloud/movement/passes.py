"""Moments of frames: cameras that film in one pass of the heads see a moving foot at the same time, others do not.

Moments are counted in frames. Frames with one number are of one moment within a pass.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import camera_numbers
from schemas.scan import MOST_CAMERA

BETWEEN_PASSES = 60
"""Moments from the last frame of a pass to frame 0 of the next: more than five of the slowest paces of a foot that
sways, after which its movement is another one."""


def find_first_moments(points: NDArray[np.void], passes: Mapping[int, int]) -> dict[int, int]:
    """Find the moment of frame 0 of each camera that has points.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`
    passes : camera -> number of the pass in which it filmed; 1 of all others

    Examples
    --------
    The third camera filmed in a second pass:

    >>> from footscan.cloud.points import make_points
    >>> points = [make_points(np.zeros((9, 3)), camera, np.arange(9)) for camera in (1, 2, 3)]
    >>> find_first_moments(np.concatenate(points), {3: 2})
    {1: 0, 2: 0, 3: 68}
    """
    cameras = camera_numbers(points)
    pass_of = {int(camera): passes.get(int(camera), 1) for camera in np.unique(cameras)}
    moments: dict[int, int] = {}
    begin = 0
    for number in sorted(set(pass_of.values())):
        filming = [camera for camera, own in pass_of.items() if own == number]
        moments |= dict.fromkeys(filming, begin)
        begin += int(points["frame"][np.isin(cameras, filming)].max()) + BETWEEN_PASSES
    return moments


def heads_in_passes(heads: Mapping[int, int], passes: Mapping[int, int]) -> dict[int, int]:
    """Number the heads anew in each pass: one that passes the foot twice shows its movement as two heads do.

    heads : camera -> number of its head. passes : as of `find_first_moments`.

    >>> heads_in_passes({1: 1, 2: 1, 3: 2}, {2: 2})
    {1: 1, 2: 3, 3: 2}
    """
    passing = {camera: (passes.get(camera, 1), head) for camera, head in heads.items()}
    numbers = sorted(set(passing.values()))
    return {camera: 1 + numbers.index(head) for camera, head in passing.items()}


def first_moment(points: NDArray[np.void], first_moments: Mapping[int, int]) -> NDArray[np.int32]:
    """(N,) moment of frame 0 of the camera of each point (N,); 0 of cameras that are not listed."""
    by_camera = np.zeros(MOST_CAMERA + 1, np.int32)
    for camera, moment in first_moments.items():
        by_camera[camera] = moment
    return by_camera[camera_numbers(points)]
