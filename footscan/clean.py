"""The points of a foot without outliers, and with the movement of the foot taken back."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.heads.planes import heads_of
from footscan.cloud.movement.passes import find_first_moments, heads_in_passes
from footscan.cloud.movement.steady import steadied
from footscan.cloud.outliers.other_laser import is_off_heel
from footscan.cloud.outliers.remove import Removed, remove_outliers
from footscan.cloud.views import View
from schemas.base.errors import Finding
from schemas.movement import MovementReport
from schemas.parameters.outliers import OutlierParameters


class Cleaned(NamedTuple):
    """The points that are kept, and why the others are not."""

    points: NDArray[np.void]
    """(K,) of `POINT_DTYPE`, mm, scanner frame, where the foot was on average"""
    removed: Removed
    movement: MovementReport


def clean(
    points: NDArray[np.void],
    views: Mapping[int, View],
    parameters: OutlierParameters,
    filmed: Mapping[int, NDArray[np.float64]] | None = None,
    passes: Mapping[int, int] = MappingProxyType({}),
) -> Cleaned:
    """Drop the outliers, and move the foot back to where it was on average.

    Parameters
    ----------
    points, views, parameters, filmed : as of `remove_outliers`
    passes : camera -> number of the pass in which it filmed; 1 of all others

    Raises
    ------
    Finding
        All points are outliers.
    """
    kept, removed = remove_outliers(points, views, parameters, filmed)
    if not len(kept):
        raise Finding("every point is an outlier, expected a foot in the control volume")
    kept, movement = steadied(kept, heads_in_passes(heads_of(views), passes), find_first_moments(kept, passes))
    if movement.x_mm and parameters.method != "levels":
        # The heel of a foot that trembles has no smooth cap that shows the stripes of other lasers.
        off = is_off_heel(kept, views)
        kept, removed = kept.compress(~off), removed.without(points, off, "laser")
    return Cleaned(kept, removed, movement)
