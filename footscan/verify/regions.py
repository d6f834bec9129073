"""Regions of a foot, by shares of its length."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.measure.frame import foot_frame
from footscan.mesh.formats.files import Shape
from footscan.mesh.rigid_transform import apply
from footscan.mesh.sampling import surface_area
from footscan.verify.distances import by_blocks
from schemas.base.errors import Finding
from schemas.base.model import Side

TOES = 0.80
"""The longest toe begins about here; its ball, at 0.56 to 0.80 of the length, is behind."""
HEEL, MIDFOOT = TOES / 3, 2 * TOES / 3
"""Where heel and midfoot end: thirds of the foot without its toes, as Cavanagh and Rodgers divide footprints, "The arch
index: a useful measure from footprints", J. Biomech. 20(5), 1987, doi:10.1016/0021-9290(87)90255-7."""
SOLE = 0.04
"""Below this height is the sole: 11 mm on a foot of 265 mm; the arch is midfoot."""
ANKLE = 0.25
"""Above this height is the ankle: below the malleoli (0.20 to 0.38 of the length), and as high as the instep."""
REGIONS = ("sole", "heel", "midfoot", "ball", "toes", "ankle")
"""`midfoot` has the instep on its upper side."""
UPRIGHT = 0.9
"""Cosine by which a foot may lean that stands with its sole down."""
DESCENT = 0.6
"""A foot's toes are lower than this share of its hind part; a box or an egg is not."""


class FootRegions(NamedTuple):
    """Tells where on a foot a point lies. Heights are shares of the length, too: the foot's own height depends on where
    the scan was cut."""

    transform: NDArray[np.float64]
    """(4, 4) from the frame of the foot to its own: X from heel to toes, floor at Z = 0; a left foot is mirrored."""
    length: float
    """mm"""

    @property
    def side(self) -> Side:
        """Which foot it is, as its toes tell."""
        return "left" if np.linalg.det(self.transform[:3, :3]) < 0 else "right"

    def of(self, points: NDArray[np.floating]) -> NDArray[np.uint8]:
        """(N,) row in `REGIONS` of each of (N, 3) points, mm. Each point has one: sole and ankle come first."""
        region = np.empty(len(points), np.uint8)

        def of_block(block: NDArray[np.float64], out: slice) -> None:
            x, _, z = apply(self.transform, block).T / self.length
            along = 1 + np.searchsorted([HEEL, MIDFOOT, TOES], x, side="right")
            region[out] = np.select([z < SOLE, z >= ANKLE], [0, len(REGIONS) - 1], along)

        by_blocks(points, of_block)
        return region


def foot_regions(shape: Shape) -> FootRegions | None:
    """The regions of a foot's mesh that stands in mm with its sole down; None where it is something else."""
    vertices, faces = shape
    if not len(faces) or not surface_area(vertices, faces) > 0:
        return None
    try:
        frame = foot_frame(vertices, faces, "unknown")
    except (Finding, IndexError):  # on an upright sheet the window of a landmark holds nothing
        return None
    if frame.transform[2, 2] < UPRIGHT:
        return None
    x, z = frame.samples[:, 0] / frame.length, frame.samples[:, 2]
    hind, front = z[x < HEEL], z[x > TOES]
    if not len(hind) or not len(front) or not front.max() < DESCENT * hind.max():
        return None
    return FootRegions(frame.transform, frame.length)
