"""Replicates of a foot: the same foot, displaced at random as the scanner may err.

Landmarks lie where the skin is outermost or highest, often on a plateau, and may move by millimetres where the skin
moves by hundredths. What that does to a measure is not linear, and is found by trying: the Monte Carlo method of JCGM
101:2008.
"""

from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from footscan.measure.frame.axis import along_axis
from footscan.measure.frame.foot_frame import SPACING_MM, FootFrame, forefoot_points
from footscan.measure.landmarks.dense_points import dense_points
from footscan.measure.uncertainty import SurfaceErrors
from footscan.mesh.rigid_transform import apply, low_height
from footscan.mesh.topology import vertex_normals
from footscan.side_by_side import together
from schemas.base.errors import Finding

REPLICATES = 16
"""Number of replicates of a foot: a bound of time, at which a standard deviation is known to 20 %."""
SEED = 101
"""Replicates of one foot are the same in every run."""

Floats = NDArray[np.float64]
NOTHING: Mapping[str, Floats] = MappingProxyType({})
_Result = TypeVar("_Result")


def of_replicates(
    foot: FootFrame,
    errors: SurfaceErrors,
    count: int,
    compute: Callable[[FootFrame], _Result],
    marked: Mapping[str, Floats] = NOTHING,
) -> list[_Result]:
    """Displace a foot at random, `count` times, find its axis anew, and return what `compute` makes of each.

    The floor stays where it is, and so do the landmarks that a person has `marked`, (3,) mm in the frame of the foot. A
    replicate that is no foot any more is left out. Where the requested axis could not be found, it is sought in the
    replicates again: what they find shows how much rests on it.
    """
    normals = vertex_normals(foot.vertices, foot.faces)
    random = np.random.default_rng(SEED)
    drawn = random.normal(size=(count, sum(errors.counts)))

    def of_one(errors_drawn: Floats) -> list[_Result]:
        try:
            vertices = foot.vertices + errors.displacements(errors_drawn)[:, None] * normals
            return [compute(_reframed(foot, vertices, marked))]
        except Finding:
            return []

    return [result for results in together(partial(of_one, one) for one in drawn) for result in results]


def _reframed(foot: FootFrame, vertices: Floats, marked: Mapping[str, Floats]) -> FootFrame:
    """The foot with other vertices, in the frame of its axis."""
    samples = dense_points(vertices, foot.faces, SPACING_MM)
    low = samples[samples[:, 2] <= low_height(foot.length)]
    forefoot = forefoot_points(vertices, foot.faces, foot.length, foot.low)
    wish = foot.axis_not_found or foot.axis
    turn, axis, length = along_axis(np.eye(4), low, forefoot, foot.length, wish, marked)
    return foot._replace(
        vertices=apply(turn, vertices),
        samples=apply(turn, samples),
        transform=turn @ foot.transform,
        axis=axis,
        length=length,
    )
