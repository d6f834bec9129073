"""Replicates of a foot: the same foot, displaced at random as the scanner may err.

Landmarks lie where the skin is outermost or highest, often on a plateau, and may move by millimetres where the skin
moves by hundredths. What that does to a measure is not linear, and is found by trying: the Monte Carlo method of JCGM
101:2008.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from footscan.measure.frame.axis import along_axis
from footscan.measure.frame.foot_frame import SPACING_MM, FootFrame, forefoot_points
from footscan.measure.landmarks.dense_points import dense_points
from footscan.mesh.rigid_transform import apply, low_height
from footscan.mesh.topology import vertex_normals
from footscan.surface.errors import ErrorField
from schemas.base.errors import Finding

REPLICATES = 16
"""Number of replicates of a foot: a bound of time, at which a standard deviation is known to 20 %."""
SEED = 101
"""Replicates of one foot are the same in every run."""

Floats = NDArray[np.float64]


def replicates(foot: FootFrame, errors: Sequence[ErrorField], count: int) -> Iterator[FootFrame]:
    """Displace a foot at random, `count` times, and find its axis anew.

    The floor stays where it is. A replicate that is no foot any more is left out.
    """
    normals = vertex_normals(foot.vertices, foot.faces)
    random = np.random.default_rng(SEED)
    variances: dict[float, Floats] = {}
    for error in errors:  # independent errors that reach as far are one field
        variances[error.reach_mm] = variances.get(error.reach_mm, 0.0) + error.deviations**2
    for _ in range(count):
        away = np.zeros(len(foot.vertices))
        for reach_mm, variance in variances.items():
            away += np.sqrt(variance) * smooth_field(foot.vertices, reach_mm, random)
        try:
            yield _reframed(foot, foot.vertices + away[:, None] * normals)
        except Finding:
            continue


def smooth_field(places: Floats, reach_mm: float, random: np.random.Generator) -> Floats:
    """Draw a field of unit variance at `places` (N, 3), mm: white noise on a grid, interpolated; on none at reach 0.

    Examples
    --------
    Neighbours share their value, places far apart do not:

    >>> places = np.array([[0.0, 0, 0], [0.1, 0, 0], [50.0, 0, 0]])
    >>> drawn = [smooth_field(places, 10.0, np.random.default_rng(seed)) for seed in range(300)]
    >>> np.corrcoef(np.transpose(drawn))[0].round(1).tolist()
    [1.0, 1.0, 0.0]
    """
    if not reach_mm:
        return random.normal(size=len(places))
    cells = places / reach_mm
    low = np.floor(cells).astype(np.int64)
    share = cells - low
    low -= low.min(axis=0)
    grid = random.normal(size=tuple(low.max(axis=0) + 2))
    total, squares = np.zeros(len(places)), np.zeros(len(places))
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, share, 1.0 - share), axis=1)
        total += weight * grid[tuple((low + corner).T)]
        squares += weight**2
    return np.asarray(total / np.sqrt(squares))


def _reframed(foot: FootFrame, vertices: Floats) -> FootFrame:
    """The foot with other vertices, in the frame of its axis."""
    samples = dense_points(vertices, foot.faces, SPACING_MM)
    low = samples[samples[:, 2] <= low_height(foot.length)]
    forefoot = forefoot_points(vertices, foot.faces, foot.length, foot.low)
    turn, axis, length = along_axis(np.eye(4), low, forefoot, foot.length, foot.axis, {})
    return foot._replace(
        vertices=apply(turn, vertices),
        samples=apply(turn, samples),
        transform=turn @ foot.transform,
        axis=axis,
        length=length,
    )
