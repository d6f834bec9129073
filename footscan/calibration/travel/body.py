"""The body that shows the travel: a block whose edges and corners are cut off, placed at an angle.

A straight bar along X looks the same in every laser plane, and says nothing of X. Each face of this body slants to X,
to Y or to Z in its own way, so that a laser plane that is displaced or turned, and a travel that is too long, move its
stripes as nothing else does. It is convex, so all heads see much of it: the faces below slant away from the glass.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, HalfspaceIntersection

Floats = NDArray[np.float64]

SIZE_MM = (150.0, 64.0, 84.0)
"""Length, breadth and height. Turned by 20 degrees it is 163 mm long and 111 mm broad: it fits into every camera's
region of support with a margin. Chosen by hand."""
CUT_MM = 24.0
"""Breadth of the cut along X, Y and Z at each edge: a chamfer of 24 mm at 45 degrees, all around."""
TOLERANCE_MM = 0.02
"""Each face may be off by so much: what a mill holds. A laser plane is then known to a third of that."""
TURN_DEG = 20.0
"""Angle of its length to the travel."""


class Body(NamedTuple):
    """A closed mesh in its own frame: Z = 0 is the face that it stands on, and its middle is above the origin."""

    vertices: Floats
    """(V, 3) mm"""
    faces: NDArray[np.int64]
    """(F, 3), counter-clockwise seen from outside"""


def standard_body() -> Body:
    """Make the block with chamfers along all twelve edges.

    Examples
    --------
    >>> body = standard_body()
    >>> print(np.ptp(body.vertices, axis=0).round(6), len(body.vertices))
    [150.  64.  84.] 32
    """
    half = np.array(SIZE_MM) / 2.0
    sides = [(sign * axis, length) for axis, length in zip(np.eye(3), half, strict=True) for sign in (1.0, -1.0)]
    for a, b in ((0, 1), (0, 2), (1, 2)):
        for first in (1.0, -1.0):
            for second in (1.0, -1.0):
                normal = np.zeros(3)
                normal[a], normal[b] = first / math.sqrt(2.0), second / math.sqrt(2.0)
                sides.append((normal, float(half[a] + half[b] - CUT_MM) / math.sqrt(2.0)))
    planes = np.array([[*normal, -distance] for normal, distance in sides])
    corners = HalfspaceIntersection(planes, np.zeros(3)).intersections
    corners = np.unique(corners.round(9), axis=0)
    hull = ConvexHull(corners)
    faces = hull.simplices.astype(np.int64)
    normals = np.cross(corners[faces[:, 1]] - corners[faces[:, 0]], corners[faces[:, 2]] - corners[faces[:, 0]])
    inwards = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0
    faces[inwards] = faces[inwards, ::-1]
    return Body(corners + np.array([0.0, 0.0, half[2]]), faces)
