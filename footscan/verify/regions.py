"""Regions of a foot, defined by shares of its length."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.measure.frame.foot_frame import foot_frame
from footscan.mesh.formats.files import Shape
from footscan.mesh.rigid_transform import apply
from footscan.mesh.sampling import surface_area
from footscan.verify.distances import by_blocks
from schemas.base.errors import Finding
from schemas.base.model import Side

TOES = 0.80
"""Share of the length at which the longest toe begins, about; the ball lies behind, at 0.56 to 0.80."""
HEEL, MIDFOOT = TOES / 3, 2 * TOES / 3
"""Shares of the length at which heel and midfoot end: thirds of the foot without its toes, as in P. Cavanagh and
M. Rodgers, "The arch index: a useful measure from footprints", J. Biomech. 20(5), 1987,
doi:10.1016/0021-9290(87)90255-7."""
SOLE = 0.04
"""Height below which the sole lies: 11 mm on a foot of 265 mm; the arch belongs to the midfoot. Chosen by hand."""
ANKLE = 0.25
"""Height above which the ankle lies: about at the malleoli (0.20 to 0.38 of the length) and the instep. Chosen by
hand."""
REGIONS = ("sole", "heel", "midfoot", "ball", "toes", "ankle")
"""Names of the regions; `midfoot` includes the instep."""
UPRIGHT = 0.9
"""Least cosine of the lean of a foot that stands with its sole down; chosen by hand."""
DESCENT = 0.6
"""The toes of a foot are lower than this share of its hind part; those of a box or an egg are not. Chosen by hand."""


class FootRegions(NamedTuple):
    """Regions of a foot. Heights are shares of the length, since the height of a scan depends on where it was cut."""

    transform: NDArray[np.float64]
    """(4, 4) from the frame of the foot to its own: X from heel to toes, floor at Z = 0; a left foot is mirrored."""
    length: float
    """mm"""

    @property
    def side(self) -> Side:
        """The side of the foot, inferred from its form."""
        return "left" if np.linalg.det(self.transform[:3, :3]) < 0 else "right"

    def of(self, points: NDArray[np.floating]) -> NDArray[np.uint8]:
        """Returns (N,) the index in `REGIONS` of each of (N, 3) points, mm; sole and ankle take precedence."""
        region = np.empty(len(points), np.uint8)

        def of_block(block: NDArray[np.float64], out: slice) -> None:
            x, _, z = apply(self.transform, block).T / self.length
            along = 1 + np.searchsorted([HEEL, MIDFOOT, TOES], x, side="right")
            region[out] = np.select([z < SOLE, z >= ANKLE], [0, len(REGIONS) - 1], along)

        by_blocks(points, of_block)
        return region


def foot_regions(shape: Shape) -> FootRegions | None:
    """Find the regions of a mesh in mm of a foot that stands sole down; None for any other shape."""
    vertices, faces = shape
    if not len(faces) or not surface_area(vertices, faces) > 0:
        return None
    try:
        frame = foot_frame(vertices, faces, "unknown")
    except (Finding, IndexError):  # on an upright sheet, the window of a landmark is empty
        return None
    if frame.transform[2, 2] < UPRIGHT:
        return None
    x, z = frame.samples[:, 0] / frame.length, frame.samples[:, 2]
    hind, front = z[x < HEEL], z[x > TOES]
    if not len(hind) or not len(front) or not front.max() < DESCENT * hind.max():
        return None
    return FootRegions(frame.transform, frame.length)
