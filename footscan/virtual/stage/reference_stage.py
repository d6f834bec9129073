"""What can stand on the glass of the virtual scanner: a foot, the block, the reference object, or nothing."""

from typing import Literal

import numpy as np

from footscan.virtual.filming.capture import prism
from footscan.virtual.foot.foot import make_foot
from footscan.virtual.optics.scene import MATT_GREY, SKIN, Mesh
from footscan.virtual.stage.block import make_block
from footscan.virtual.stage.pictures import Subject
from footscan.virtual.stage.reference import standard_reference
from footscan.virtual.stage.standing import BLOCK_TURN_DEG, stand_on_glass
from schemas.reference import ReferenceObject

NOTHING = Subject(None)


def foot_subject(side: Literal["right", "left"], middle_x_mm: float) -> Subject:
    """The parametric foot, its middle at X = `middle_x_mm`, Y = 0."""
    foot = make_foot(side=side)
    return Subject(Mesh(stand_on_glass(foot.vertices, middle_x_mm), foot.faces.astype(np.int64)), SKIN)


def block_subject(middle_x_mm: float, turn_deg: float = BLOCK_TURN_DEG) -> Subject:
    """The block of 150 x 100 x 50 mm, turned about Z, its middle at X = `middle_x_mm`, Y = 0."""
    vertices, faces = make_block()
    return Subject(Mesh(stand_on_glass(vertices, middle_x_mm, turn_deg), faces.astype(np.int64)))


def reference_subject(middle_x_mm: float, placement: int = 0, reference: ReferenceObject | None = None) -> Subject:
    """The reference object in one of its placements, its middle along X at `middle_x_mm`."""
    reference = reference or standard_reference()
    shape = prism(np.asarray(reference.profile_mm) + np.asarray(reference.placements_mm[placement]))
    return Subject(Mesh(shape.vertices + np.array([middle_x_mm, 0.0, 0.0]), shape.faces), MATT_GREY)
