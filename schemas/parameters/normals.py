"""Parameters of the estimation of normals."""

from typing import Annotated

from pydantic import Field

from schemas.documents import Document

Direction = tuple[float, float]
Camera = Annotated[int, Field(ge=1, le=64)]

CAMERA_DIRECTIONS: dict[int, Direction] = {
    1: (0.7, 0.7),
    2: (0.7, 0.7),
    3: (-0.7, 0.7),
    4: (-0.7, 0.7),
    5: (0.4, -0.9),
    6: (0.4, -0.9),
    7: (-0.4, -0.9),
    8: (-0.4, -0.9),
}
"""Cameras 1 and 2 look from above on the +Y side, 3 and 4 on the -Y side, 5 to 8 at the sole from below."""


class NormalParameters(Document):
    """Over which neighbourhood a plane is fitted, and what is outside."""

    radius_steps: Annotated[float, Field(gt=1, le=25)] = 2.25
    """Radius of the neighbourhood, in steps from stripe to stripe: two stripe planes to either side."""
    neighbours: Annotated[int, Field(ge=6, le=500)] = 80
    """At most so many nearest points of it."""
    camera_directions: dict[Camera, Direction] = CAMERA_DIRECTIONS
    """Rough (Y, Z) of the direction in which each camera stands, seen from the foot."""
