"""What can stand on the glass of the virtual scanner: a foot, the block, the reference object, or nothing."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from footscan.virtual.block import make_block
from footscan.virtual.capture import prism
from footscan.virtual.foot import make_foot
from footscan.virtual.reference import standard_reference
from footscan.virtual.scene import MATT_GREY, SKIN, Mesh
from footscan.virtual.stage_pictures import Subject
from schemas.reference import ReferenceObject

Floats = NDArray[np.float64]

NOTHING = Subject(None)
BLOCK_TURN_DEGREES = 5.0
"""Stripes run in over the edges of a turned block bit by bit, which tells where the heads are."""


def foot_subject(side: Literal["right", "left"], middle_x_mm: float) -> Subject:
    """The parametric foot, its middle at X = `middle_x_mm`, Y = 0."""
    foot = make_foot(side=side)
    return Subject(Mesh(_placed(foot.vertices, middle_x_mm), foot.faces.astype(np.int64)), SKIN)


def block_subject(middle_x_mm: float, turn_degrees: float = BLOCK_TURN_DEGREES) -> Subject:
    """The block of 150 x 100 x 50 mm, turned about Z, its middle at X = `middle_x_mm`, Y = 0."""
    vertices, faces = make_block()
    cos, sin = np.cos(np.radians(turn_degrees)), np.sin(np.radians(turn_degrees))
    turned = vertices @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return Subject(Mesh(_placed(turned, middle_x_mm), faces.astype(np.int64)))


def reference_subject(middle_x_mm: float, placement: int = 0, reference: ReferenceObject | None = None) -> Subject:
    """The reference object in one of its placements, its middle along X at `middle_x_mm`."""
    reference = reference or standard_reference()
    shape = prism(np.asarray(reference.profile_mm) + np.asarray(reference.placements_mm[placement]))
    return Subject(Mesh(shape.vertices + np.array([middle_x_mm, 0.0, 0.0]), shape.faces), MATT_GREY)


def _placed(vertices: Floats, middle_x_mm: float) -> Floats:
    """`vertices` on the glass, Z = 0, with their middle at X and at Y = 0."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle = (low + high) / 2.0
    return np.asarray(vertices + np.array([middle_x_mm - middle[0], -middle[1], -low[2]]), np.float64)
